"""Mutated proofs, judged by the checker in this process.

    proofs.py CHECKER SEED COUNT PROOF=REACHED... [CORPUS]

REACHED is what a plan that was found has: {"3": rho0_m}. Prints JSON: how many were well formed, held, were refused or
cannot be checked, and what failed.

What must not happen: an exception, a hang, a file that changes what it says when it is checked again, or a proof that
holds of the question as it was and bounds plans above a plan that there is.
"""

import contextlib
import copy
import importlib.util
import json
import random
import signal
import sys
import warnings
from pathlib import Path

#: No proof takes longer, on a machine with other work to do.
LONGEST_S = 60
NUMBERS = [0, -1, 1, 2, 7, 0.5, 1e-300, -1e-9, 1e-9, 1e9, 1e154, 1e300, -1e300, 5e-324, 2**31, 2**63, 2**64, 10**400, -(10**400), 1e5]
VALUES = [*NUMBERS, None, True, False, "", "x", "1", [], {}, [[]], [0], [1, 2, 3], {"x": 1}, "\u0000", "9" * 400]
#: What a claim is about; the rest is the prover's word.
QUESTION = ("sigma_m", "prior_precision")


class Late(Exception):
    """It took too long."""


def late(*_):
    raise Late


def places(value, path=()):
    """The paths of all parts of a value."""
    yield path
    parts = value.items() if isinstance(value, dict) else enumerate(value) if isinstance(value, list) else ()
    for key, part in parts:
        yield from places(part, (*path, key))


def at(value, path):
    for key in path:
        value = value[key]
    return value


def changed_part(rng, file, below=()):
    """Something is done to one part of a file, below a path."""
    path = below + rng.choice(list(places(at(file, below)))[1:] or [()])
    if not path:
        return
    parent, key = at(file, path[:-1]), path[-1]
    value = parent[key]
    what = rng.randrange(8)
    if isinstance(value, (int, float)) and not isinstance(value, bool) and rng.random() < 0.5:
        factor = rng.choice([-1, 0, 0.5, 0.9, 0.999999, 1.000001, 1.1, 2, 1e6])
        parent[key] = value * factor if abs(value) < 1e300 else factor
    elif what == 0:
        del parent[key]
    elif what == 1 and isinstance(parent, list):
        parent.insert(key, copy.deepcopy(value))
    elif what == 2 and isinstance(parent, list):
        rng.shuffle(parent)
    elif what == 3 and isinstance(parent, dict):
        parent[rng.choice(["", "x", *map(str, parent)])] = parent.pop(key)
    elif what == 4 and isinstance(value, (list, dict)):
        deep = value
        for _ in range(rng.choice([1, 2000])):
            deep = [deep]
        parent[key] = deep
    elif what == 5 and isinstance(value, str) and value:
        cut = rng.randrange(len(value))
        parent[key] = value[:cut] + rng.choice(["", ".", "x00", "m0", "0", "f", "\u0000"]) + value[cut + rng.randrange(3) :]
    elif what == 6:
        other = at(file, rng.choice(list(places(file))))
        parent[key] = copy.deepcopy(other) if len(json.dumps(other)) < 10000 else None
    else:
        parent[key] = copy.deepcopy(rng.choice(VALUES))


def tree(rng, variables, depth=0):
    """A tree of halvings that the grammar allows."""
    kind = rng.random()
    if depth < 6 and kind < 0.5:
        return f"{rng.randrange(variables):x}" + tree(rng, variables, depth + 1) + tree(rng, variables, depth + 1)
    if kind < 0.7:
        return "."
    if kind < 0.85:
        return f"x{rng.randrange(8):02x}"
    count = rng.randrange(3)
    return f"m{count:x}" + "".join(f"{rng.randrange(8):02x}{rng.getrandbits(24):06x}" for _ in range(count))


def false_claim(rng, file, reached):
    """The file claims what a plan refutes, and says otherwise whatever a prover could say."""
    factor = 1.0
    bounds = dict((m, rho0) for m, rho0 in file["bounds"])
    for m, rho0 in reached.items():
        factor = max(factor, rho0 / bounds[int(m)] * rng.choice([1.0001, 1.01, 1.5, 10]))
    if rng.random() < 0.8:
        # As if the largest derivative were so much smaller.
        file["proof"]["largest"] /= (factor * rng.choice([1.0, 1.01, 1.1, 2])) ** 2
    file["bounds"] = [[m, rho0 * factor] for m, rho0 in file["bounds"]]
    for _ in range(rng.randrange(4)):
        part = rng.choice(file["proof"]["parts"])
        size = max(len(part["ranges"]), 1)
        what = rng.randrange(11)
        if what == 0:
            part["tree"] = tree(rng, size)
        elif what == 1:
            part["tree"] = part["tree"].replace(".", rng.choice([f"x{k:02x}" for k in range(6)]), rng.choice([1, 5, -1]))
        elif what == 2:
            part["ranges"] = [[low / 2**shrink, high / 2**shrink] for shrink in [rng.randrange(5)] for low, high in part["ranges"]]
        elif what == 3:
            each = rng.choice(part["ranges"])
            each[rng.randrange(2)] = rng.choice([0.0, *each])
        elif what == 4:
            part["variables"][rng.randrange(len(part["variables"]))] = rng.choice([None, 0, 1, 2, -1])
        elif what == 5:
            part["ranges"] += rng.choice([[], [[0.5, 1.0]], [[1.0, 1.0]]])
        elif what == 6:
            which = rng.randrange(len(part["starts_run"]))
            part["starts_run"][which] = not part["starts_run"][which]
        elif what == 7:
            part["middle"] = rng.randrange(-1, 9)
        elif what == 8:
            part["wrench"] = rng.choice([None, [0.0] * 6, [0.0, 0.0, 1.0, 0.0, 0.0, 0.0]])
        elif what == 9:
            file["proof"]["parts"] = rng.choice([[], file["proof"]["parts"][:1], file["proof"]["parts"] * 2])
            if not file["proof"]["parts"]:
                return
        else:
            key = rng.choice(["printed", "prior", "weights"])
            if key == "weights":
                # As if the poses weighed more, so that all that is left does.
                for target in file["targets"]:
                    target["weight"] *= factor**2
                continue
            file[key] = rng.choice([0, -1, -1e300, [0, -1e300], [-1, 0], [3, 0.0], None, 1.0])
    if rng.random() < 0.3:
        below = rng.choice([("proof", "parts"), ("proof", "largest"), ("bounds",)])
        changed_part(rng, file, below if isinstance(at(file, below), list) else ())


def changed_text(rng, text):
    """Bytes of a text of which tokens or bytes are gone, doubled, swapped or extreme."""
    for _ in range(rng.choice([1, 1, 2, 5])):
        start = rng.randrange(max(len(text), 1))
        end = start + rng.choice([1, 1, 5, 50])
        what = rng.randrange(6)
        token = text[start:end]
        if what == 0:
            text = text[:start] + text[end:]
        elif what == 1:
            text = text[:end] + token + text[end:]
        elif what == 2:
            text = text[:start] + rng.choice(["NaN", "1e999", "-Infinity", "9" * 400, "null", "{", "]", "\u0000", '"', ","]) + text[end:]
        elif what == 3:
            text = text[:start]
        elif what == 4:
            text = text[:start] + token[::-1] + text[end:]
        else:
            other = rng.randrange(max(len(text), 1))
            text = text[:start] + text[other : other + 20] + text[end:]
    content = text.encode("utf-8", "replace")
    return rng.choice([content] * 8 + [b"\xef\xbb\xbf" + content, text.encode("utf-16", "replace"), content + b"\xff"])


def without_weights(file):
    """What a claim is about; weights of test poses mean the same however they are scaled, and must sum to one."""
    targets = [{key: value for key, value in target.items() if key != "weight"} for target in file["targets"]]
    return [file["proof"]["question"], targets, *(file.get(key) for key in QUESTION)]


def is_unchanged_question(file, whole):
    return without_weights(file) == without_weights(whole)


def claims_too_much(content, whole, reached):
    """Whether a proof that holds is of the question as it was, and refuted by a plan that there is."""
    file = json.loads(content)
    if not is_unchanged_question(file, whole):
        return False
    return any(rho0 > reached.get(str(m), float("inf")) * (1 + 1e-9) for m, rho0 in file["bounds"])


def judged(checker, content):
    signal.alarm(LONGEST_S)
    try:
        with contextlib.redirect_stdout(sys.stderr):
            return checker.verdict(content)
    finally:
        signal.alarm(0)


def main():
    checker_file, seed, count = sys.argv[1], sys.argv[2], int(sys.argv[3])
    spec = importlib.util.spec_from_file_location("check_proof", checker_file)
    checker = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(checker)
    signal.signal(signal.SIGALRM, late)
    warnings.simplefilter("ignore")
    proofs, inputs = [], []
    for argument in sys.argv[4:]:
        path, _, reached = argument.partition("=")
        if reached:
            proofs.append((Path(path).read_text(encoding="utf-8"), json.loads(reached)))
        else:
            inputs += [(each.name, each.read_bytes(), 0) for each in sorted(Path(path).iterdir())]
    wholes = [json.loads(text) for text, _ in proofs]
    counts = {"well_formed": 0, "holds": 0, "refused": 0, "cannot be checked": 0}
    failures = []

    def look(name, content, index):
        problem = None
        try:
            code, lines = judged(checker, content)
            if code not in (0, 1, 2) or not lines or not all(isinstance(line, str) and line for line in lines):
                problem = f"it ends with {code} and says {lines}"
            elif code == 0 and claims_too_much(content, wholes[index], proofs[index][1]):
                problem = "it holds, and a plan that there is refutes it"
            counts[("holds", "refused", "cannot be checked")[code]] += 1
            counts["well_formed"] += "is no proof" not in lines[0]
        except Late:
            problem = f"it takes longer than {LONGEST_S} s"
        except Exception as error:
            problem = f"{type(error).__name__}: {error}"
        if problem:
            failures.append({"name": name, "problem": problem[:300], "content": content.decode("latin-1")})

    for index, (text, reached) in enumerate(proofs):
        code, lines = judged(checker, text.encode())
        if code != 0 or claims_too_much(text, wholes[index], reached):
            failures.append({"name": f"proof {index}", "problem": f"as it was: {lines}", "content": ""})
    for name, content, index in inputs:
        look(name, content, index)
    for number in range(count):
        rng = random.Random(f"{seed} {number}")
        index = rng.randrange(len(proofs))
        text, reached = proofs[index]
        kind = number % 3
        if kind == 0:
            content = changed_text(rng, text)
        else:
            file = copy.deepcopy(wholes[index])
            try:
                if kind == 1:
                    for _ in range(rng.choice([1, 1, 2, 4])):
                        changed_part(rng, file)
                else:
                    false_claim(rng, file, reached)
                content = json.dumps(file).encode()
            except (RecursionError, KeyError, IndexError, TypeError, ValueError, AttributeError, OverflowError):
                # What a mutation has spoilt cannot be changed again.
                continue
        look(f"{seed}-{number}", content, index)
    print(json.dumps({"counts": counts, "failures": failures}))


main()
