"""elastocal's side: its bench driver, in a process that waits for requests."""

import json
import subprocess
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]


def executable() -> str:
    """Builds the driver and gives its path, which has a hash in it."""
    command = ["cargo", "build", "--release", "--locked", "--quiet", "--bench", "driver", "--message-format=json"]
    built = subprocess.run(command, cwd=ROOT, stdout=subprocess.PIPE, check=True, text=True)
    messages = [json.loads(line) for line in built.stdout.splitlines() if line.startswith("{")]
    return next(
        message["executable"]
        for message in messages
        if message["reason"] == "compiler-artifact" and message["target"]["name"] == "driver"
    )


class Driver:
    def __init__(self) -> None:
        self.path = executable()
        self.process = subprocess.Popen(
            [self.path, "serve"], cwd=ROOT, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
        )

    def problem(self) -> dict:
        told = subprocess.run([self.path, "problem"], cwd=ROOT, check=True, capture_output=True)
        return json.loads(told.stdout)

    def seconds(self, path: str, times: int) -> float:
        """How long so many repetitions of a path take."""
        self.process.stdin.write(f"{path} {times}\n")
        self.process.stdin.flush()
        answer = self.process.stdout.readline()
        assert answer, f"the driver ended at {path}"
        return float(answer)

    def close(self) -> None:
        self.process.stdin.close()
        self.process.wait()
