#!/usr/bin/env python3
"""Looks at an HTML page in a headless Chromium and prints what it saw as JSON.

    look_at_page.py CHROMIUM PAGE [--width PX] [--dark] [--paper a4|letter] [--screenshot FILE.png] [--element SELECTOR] [--pdf FILE.pdf]

Speaks the DevTools protocol over a pipe, with the standard library alone.
"""

import argparse
import base64
import json
import os
import pathlib
import re
import select
import subprocess
import sys
import tempfile
import time

TIMEOUT_S = 60
MM_PER_INCH = 25.4
# Width and height of sheets, and what @page in the style of pages leaves free to the left and right of them (mm).
PAPERS_MM = {"a4": (210, 297), "letter": (215.9, 279.4)}
MARGINS_MM = 28

OPTIONS = [
    "--headless", "--no-sandbox", "--disable-gpu", "--disable-quic", "--no-first-run",
    "--disable-background-networking", "--disable-component-update", "--disable-sync",
    "--disable-extensions", "--disable-dev-shm-usage", "--hide-scrollbars",
    "--remote-debugging-pipe",
]

# What a person would see: figures with their content, text that is cut off, faint (a contrast below 4.5 to 1, as WCAG 2 has it), smaller
# than 11 px, or covers other text, and whether the page is wider than the window.
LOOK = r"""
(() => {
  const box = element => element.getBoundingClientRect();
  const label = element => element.getAttribute("aria-label")
    || (element.parentElement && element.parentElement.getAttribute("aria-label")) || "";
  const figures = [...document.querySelectorAll("svg")].map(svg => {
    const frame = box(svg);
    const texts = [...svg.querySelectorAll("text")].filter(text => text.textContent.trim());
    const boxes = texts.map(box);
    const name = text => text.textContent.trim();
    const outside = texts.filter((text, i) => boxes[i].left < frame.left - 1
      || boxes[i].right > frame.right + 1 || boxes[i].top < frame.top - 1
      || boxes[i].bottom > frame.bottom + 1).map(name);
    const overlaps = [];
    for (let i = 0; i < texts.length; i++)
      for (let j = 0; j < i; j++) {
        const [a, b] = [boxes[i], boxes[j]];
        const width = Math.min(a.right, b.right) - Math.max(a.left, b.left);
        const height = Math.min(a.bottom, b.bottom) - Math.max(a.top, b.top);
        // The boxes are a little higher than the letters.
        const lines = Math.min(a.height, b.height);
        if (width > 1 && height > 0.3 * lines) overlaps.push([name(texts[j]), name(texts[i])]);
      }
    const drawn = svg.querySelectorAll("line,rect,circle,polyline,polygon,path");
    const pictures = [...svg.querySelectorAll("image")].map(each => each.getBBox());
    const content = svg.getBBox();
    return {
      label: label(svg), width_px: frame.width, height_px: frame.height,
      content_px: [content.width, content.height], shapes: drawn.length, pictures_px: pictures.map(each => each.width), texts: texts.length,
      smallest_text_px: Math.min(...boxes.map(each => Math.min(each.width, each.height)), 1e9),
      outside, overlaps,
    };
  });
  // A view that turns is drawn, and shows another picture after a step.
  const views = [...document.querySelectorAll(".turning canvas")].filter(each => box(each).width > 0).map(canvas => {
    const { data } = canvas.getContext("2d").getImageData(0, 0, canvas.width, canvas.height);
    const drawn = data.filter((value, i) => i % 4 === 3 && value === 255).length / (data.length / 4);
    const before = canvas.toDataURL();
    const next = canvas.parentElement.querySelector("button[aria-label=next]");
    next.click();
    const steps = canvas.toDataURL() !== before, words = canvas.parentElement.innerText;
    // However it is turned, nothing reaches the edge.
    const { width, height } = canvas;
    const sides = [[0, 0, width, 1], [0, height - 1, width, 1], [0, 0, 1, height], [width - 1, 0, 1, height]];
    const copy = Object.assign(document.createElement("canvas"), { width, height }).getContext("2d", { willReadFrequently: true });
    const is_cut = () => {
      copy.clearRect(0, 0, width, height);
      copy.drawImage(canvas, 0, 0);
      return sides.some(side => copy.getImageData(...side).data.some((value, i) => i % 4 === 3 && value === 255));
    };
    let cut = 0;
    for (const key of ["ArrowLeft", "ArrowLeft", "ArrowDown", "ArrowLeft", "ArrowLeft", "ArrowUp", "ArrowLeft", "ArrowUp", "ArrowLeft"]) {
      for (let i = 0; i < 9; i++) canvas.dispatchEvent(new KeyboardEvent("keydown", { key }));
      next.click();
      cut += is_cut();
    }
    canvas.dispatchEvent(new MouseEvent("dblclick"));
    return { drawn, steps, words, cut };
  });
  const parts = colour => colour.match(/[\d.]+/g).map(Number);
  const luminance = colour => parts(colour).slice(0, 3).map(each => each / 255)
    .map(each => each <= 0.04045 ? each / 12.92 : ((each + 0.055) / 1.055) ** 2.4)
    .reduce((sum, each, i) => sum + each * [0.2126, 0.7152, 0.0722][i], 0);
  const ground = element => {
    for (let each = element; each; each = each.parentElement) {
      const colour = getComputedStyle(each).backgroundColor;
      if (parts(colour)[3] !== 0) return colour;
    }
    return "rgb(255, 255, 255)";
  };
  const contrast = element => {
    const style = getComputedStyle(element);
    const colours = [element.closest("svg") ? style.fill : style.color, ground(element)];
    const [dark, light] = colours.map(luminance).sort((a, b) => a - b);
    return (light + 0.05) / (dark + 0.05);
  };
  const elements = [...document.querySelectorAll("body *")].filter(each => box(each).width > 0);
  const shown = each => each.textContent.trim().slice(0, 60);
  const has_text = each => [...each.childNodes].some(node => node.nodeType === 3 && node.data.trim());
  const faint = elements.filter(each => has_text(each) && contrast(each) < 4.5).map(shown);
  // The boxes of tables and figures scroll.
  const scrolls = each => each.matches(".wide") && getComputedStyle(each).overflowX === "auto";
  const cut = elements.filter(each => !each.closest("svg") && each.clientWidth > 0
    && each.scrollWidth > each.clientWidth + 1 && !scrolls(each)).map(shown);
  // The height of letters as they are rendered.
  const letters = each => parseFloat(getComputedStyle(each).fontSize) * (each.closest("svg") ? Math.hypot(each.getScreenCTM().a, each.getScreenCTM().b) : 1);
  const small = elements.filter(each => has_text(each) && letters(each) < 10.95).map(each => `${letters(each).toFixed(1)} px: ${shown(each)}`);
  const root = document.documentElement;
  return {
    faint, cut, small,
    title: document.title, text: document.body.innerText,
    scripts: document.scripts.length,
    page_px: [root.scrollWidth, root.scrollHeight], window_px: root.clientWidth, figures, views,
  };
})()
"""


class Browser:
    def __init__(self, program, profile):
        to_browser, self.writer = os.pipe()
        self.reader, from_browser = os.pipe()
        # The browser reads from 3 and writes to 4.
        command = f'exec "$0" "$@" 3<&{to_browser} 4>&{from_browser}'
        self.log = tempfile.TemporaryFile()
        self.process = subprocess.Popen(
            ["/bin/sh", "-c", command, program, *OPTIONS, f"--user-data-dir={profile}", "about:blank"],
            pass_fds=(to_browser, from_browser), stdin=subprocess.DEVNULL,
            stdout=subprocess.DEVNULL, stderr=self.log)
        os.close(to_browser)
        os.close(from_browser)
        self.rest = b""
        self.number = 0
        self.events = []
        self.deadline = time.monotonic() + TIMEOUT_S

    def message(self, wait_s):
        """The next message, or None if none comes in time."""
        while b"\0" not in self.rest:
            left = min(wait_s, self.deadline - time.monotonic())
            ready, _, _ = select.select([self.reader], [], [], max(left, 0))
            if not ready:
                return None
            data = os.read(self.reader, 1 << 20)
            if not data:
                self.log.seek(0)
                said = self.log.read().decode(errors="replace")
                raise SystemExit(f"the browser ended: {said[-2000:]}")
            self.rest += data
        text, self.rest = self.rest.split(b"\0", 1)
        return json.loads(text)

    def call(self, method, session=None, **parameters):
        self.number += 1
        request = {"id": self.number, "method": method, "params": parameters}
        if session:
            request["sessionId"] = session
        os.write(self.writer, json.dumps(request).encode() + b"\0")
        while True:
            message = self.message(TIMEOUT_S)
            if message is None:
                raise SystemExit(f"no answer to {method} in {TIMEOUT_S} s")
            if message.get("id") == self.number:
                if "error" in message:
                    raise SystemExit(f"{method}: {message['error']}")
                return message["result"]
            self.events.append(message)

    def wait_for(self, event):
        while not any(each.get("method") == event for each in self.events):
            message = self.message(TIMEOUT_S)
            if message is None:
                raise SystemExit(f"no {event} in {TIMEOUT_S} s")
            self.events.append(message)

    def listen(self, seconds):
        end = time.monotonic() + seconds
        while time.monotonic() < end:
            message = self.message(end - time.monotonic())
            if message is not None:
                self.events.append(message)

    def close(self):
        self.process.terminate()
        try:
            self.process.wait(10)
        except subprocess.TimeoutExpired:
            self.process.kill()
            self.process.wait()


def look(browser, page, given):
    width = given.width
    if given.paper:
        paper = PAPERS_MM[given.paper]
        width = round((paper[0] - MARGINS_MM) * 96 / MM_PER_INCH)
    target = browser.call("Target.createTarget", url="about:blank")["targetId"]
    session = browser.call("Target.attachToTarget", targetId=target, flatten=True)["sessionId"]
    call = lambda method, **parameters: browser.call(method, session, **parameters)
    for domain in ["Page", "Runtime", "Log", "Network"]:
        call(f"{domain}.enable")
    call("Emulation.setDeviceMetricsOverride", width=width, height=900, deviceScaleFactor=1,
         mobile=width < 700)
    scheme = {"name": "prefers-color-scheme", "value": "dark" if given.dark else "light"}
    call("Emulation.setEmulatedMedia", media="print" if given.paper else "", features=[scheme])
    browser.events.clear()
    call("Page.navigate", url=page.resolve().as_uri())
    browser.wait_for("Page.loadEventFired")
    browser.listen(0.3)
    answer = call("Runtime.evaluate", expression=LOOK, returnByValue=True)
    if "exceptionDetails" in answer:
        raise SystemExit(f"the look failed: {answer['exceptionDetails']}")
    seen = answer["result"]["value"]
    if given.screenshot:
        clip = {"x": 0, "y": 0, "width": width, "height": seen["page_px"][1]}
        if given.element:
            # What is folded away has no picture.
            element = f"document.querySelector({json.dumps(given.element)})"
            call("Runtime.evaluate", expression=f"for (let each = {element}; each; each = each.parentElement) each.open = true")
            box = f"{element}.getBoundingClientRect().toJSON()"
            clip = call("Runtime.evaluate", expression=box, returnByValue=True)["result"]["value"]
            clip = {key: clip[key] for key in ["x", "y", "width", "height"]}
        picture = call("Page.captureScreenshot", format="png", captureBeyondViewport=True, clip={**clip, "scale": 1})
        given.screenshot.write_bytes(base64.b64decode(picture["data"]))
    parameters = lambda method: [
        each["params"] for each in browser.events if each.get("method") == method]
    seen["console"] = [
        " ".join(str(value.get("value", value.get("description"))) for value in each["args"])
        for each in parameters("Runtime.consoleAPICalled")]
    seen["errors"] = [
        each["exceptionDetails"]["text"] for each in parameters("Runtime.exceptionThrown")
    ] + [each["entry"]["text"] for each in parameters("Log.entryAdded")]
    # What stands in the page itself is not asked for.
    seen["requests"] = [
        each["request"]["url"] for each in parameters("Network.requestWillBeSent")
        if not each["request"]["url"].startswith("data:")]
    if given.paper:
        across, down = (side / MM_PER_INCH for side in paper)
        printed = call("Page.printToPDF", paperWidth=across, paperHeight=down, preferCSSPageSize=True,
                       printBackground=True)
        pdf = base64.b64decode(printed["data"])
        sizes = re.findall(rb"/MediaBox \[0 0 ([\d.]+) ([\d.]+)\]", pdf)
        seen["pages_mm"] = [[float(side) * MM_PER_INCH / 72 for side in size] for size in sizes]
        if given.pdf:
            given.pdf.write_bytes(pdf)
    return seen


def main():
    arguments = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    arguments.add_argument("chromium")
    arguments.add_argument("page", type=pathlib.Path)
    arguments.add_argument("--width", type=int, default=1280)
    arguments.add_argument("--dark", action="store_true")
    arguments.add_argument("--paper", choices=PAPERS_MM)
    arguments.add_argument("--screenshot", type=pathlib.Path)
    arguments.add_argument("--element", help="the part that a screenshot shows (a CSS selector)")
    arguments.add_argument("--pdf", type=pathlib.Path)
    given = arguments.parse_args()
    with tempfile.TemporaryDirectory(ignore_cleanup_errors=True) as profile:
        browser = Browser(given.chromium, profile)
        try:
            seen = look(browser, given.page, given)
        finally:
            browser.close()
    json.dump(seen, sys.stdout, indent=1)
    print()


if __name__ == "__main__":
    main()
