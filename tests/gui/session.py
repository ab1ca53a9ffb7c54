"""A person at QGIS, played: real windows under Xvfb, real mouse and keys by xdotool, pictures of the screen.

python3 tests/gui/session.py SIMULATION SURVEY FOLDER [--font 2]

SIMULATION is a folder of 'Simulate survey', SURVEY a survey made of its JPG in that folder, georeferenced by GNSS. Both go to
FOLDER, and the pictures, too. Points are marked where the simulation says they are; after the adjustment the residuals must be
as expected, and the marks nearer to where the points should be seen.
"""

import argparse
import csv
import json
import os
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path

HERE = Path(__file__).resolve().parent
ROOT = HERE.parents[1]
SIZE = "1280x900"


class Screen:
    """An X server of its own with a window manager; gone with all on it at the end."""

    def __init__(self, number: int, folder: Path) -> None:
        self.environment = {**os.environ, "DISPLAY": f":{number}"}
        self.environment.pop("QT_QPA_PLATFORM", None)
        self.folder, self.number = folder, number
        self.processes = [self.start("Xvfb", f":{number}", "-screen", "0", f"{SIZE}x24", "-nolisten", "tcp")]
        time.sleep(1.5)
        self.processes.append(self.start("openbox"))

    def start(self, *words, **more):
        with (self.folder / f"{Path(words[0]).name}.log").open("wb") as log:
            environment = {**self.environment, **more}
            return subprocess.Popen(words, env=environment, stdout=log, stderr=subprocess.STDOUT, start_new_session=True)

    def do(self, *words):
        subprocess.run(["xdotool", *map(str, words)], env=self.environment, check=True)

    def click(self, x, y):
        self.do("mousemove", "--sync", round(x), round(y))
        time.sleep(0.1)
        self.do("click", 1)

    def shot(self, name):
        self.count = getattr(self, "count", 0) + 1
        path = self.folder / f"{self.count:02d}-{name}.png"
        subprocess.run(["import", "-window", "root", str(path)], env=self.environment, check=True)
        print("picture", path, flush=True)

    def close(self):
        for process in reversed(self.processes):
            try:
                os.killpg(process.pid, signal.SIGTERM)
                process.wait(10)
            except (ProcessLookupError, subprocess.TimeoutExpired):
                process.kill()


class Session:
    """QGIS on a screen, with the dock open."""

    def __init__(self, screen, folder, simulation, survey, font):
        self.screen, self.state_path = screen, folder / "state.json"
        profile = folder / "profile"
        environment = {
            "QGIS_CUSTOM_CONFIG_PATH": str(profile),
            "QGIS_PLUGINPATH": str(ROOT / ".build" / "plugins"),
            "STRANDLINE_GUI_STATE": str(self.state_path),
            "STRANDLINE_GUI_SIMULATION": str(simulation),
            "STRANDLINE_GUI_SURVEY": str(survey),
            "STRANDLINE_GUI_MARKS": str(folder / "marks.gpkg"),
        }
        if font != 1:
            environment["QT_FONT_DPI"] = str(round(96 * font))
            environment["STRANDLINE_GUI_WIDTH"] = "760"
        program = "qgis_process.bin" if shutil.which("qgis_process.bin") else "qgis_process"
        enable = {**screen.environment, **environment, "QT_QPA_PLATFORM": "offscreen"}
        subprocess.run([program, "plugins", "enable", "strandline"], env=enable, check=True, capture_output=True)
        qgis = "qgis.bin" if shutil.which("qgis.bin") else "qgis"
        code = str(HERE / "inside.py")
        screen.processes.append(screen.start(qgis, "--noversioncheck", "--nologo", "--code", code, **environment))

    @property
    def state(self):
        return json.loads(self.state_path.read_text())

    def wait(self, condition, what, seconds=240):
        end = time.monotonic() + seconds
        while time.monotonic() < end:
            if self.state_path.exists() and condition(self.state):
                return self.state
            time.sleep(0.15)
        self.screen.shot("stuck")
        raise SystemExit(f"QGIS did not come to this: {what}; it says {self.state if self.state_path.exists() else 'nothing'}")

    def pick(self, point):
        for _ in range(60):
            item, (left, top, width, height) = self.state["items"][point], self.state["list"]
            if item["shown"]:
                break
            self.screen.do("mousemove", "--sync", left + width // 2, top + height // 2)
            self.screen.do("click", 4 if item["rect"][1] < top else 5)
            time.sleep(0.3)
        x, y, w, h = item["rect"]
        self.screen.click(x + min(60, w / 2), y + h / 2)
        self.wait(lambda s: s["key"] and s["key"][0] == point, f"{point} picked")

    def mark(self, truth):
        """Click where the point of the photograph that is shown truly is; return how far off the mark is."""
        state = self.wait(lambda s: 1 in s["levels"], "the photograph in full")
        while True:  # the room the photograph has may still be changing
            time.sleep(0.6)
            before, state = state, self.state
            if state["viewer"] == before["viewer"]:
                break
        key = tuple(state["key"])
        x, y = truth[key]
        (left, top), scale = state["viewer"]["corner"], state["viewer"]["scale"]
        # The middle of a screen's pixel is half a pixel on.
        self.screen.click(left + x * scale - 0.5, top + y * scale - 0.5)
        made = self.wait(lambda s: any(tuple(m[:2]) == key for m in s["marks"]), f"a mark of {key}")
        mark = next(m for m in made["marks"] if tuple(m[:2]) == key)
        off = max(abs(mark[2] - x), abs(mark[3] - y))
        limit = 0.5 / scale + 0.05
        if off > limit:
            raise SystemExit(f"The mark of {key} lies {off:.2f} px off, {limit:.2f} is what a pixel of the screen allows.")
        return off


def mean(values):
    return sum(values) / len(values)


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("simulation", type=Path)
    parser.add_argument("survey", type=Path)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--font", type=float, default=1)
    parser.add_argument("--display", type=int, default=77)
    given = parser.parse_args()
    given.folder.mkdir(parents=True)
    simulation, survey = given.folder / "sim", given.folder / "sim" / given.survey.name
    shutil.copytree(given.simulation, simulation)
    if not survey.exists():
        shutil.copytree(given.survey, survey)
    (marks,) = simulation.glob("????-*/marks.csv")
    with marks.open() as stream:
        truth = {(r["gcp"], r["image"]): (float(r["x"]), float(r["y"])) for r in csv.DictReader(stream)}
    screen = Screen(given.display, given.folder)
    try:
        session = Session(screen, given.folder, simulation, survey, given.font)
        session.wait(lambda s: s["predictions"] and not s["busy"], "predictions")
        time.sleep(1)
        screen.shot("predicted")
        offs = []
        for point in ("G1", "G2", "G3", "G4", "G5"):
            session.pick(point)
            for photograph in range(3):
                offs.append(session.mark(truth))
                if (point, photograph) == ("G1", 0):
                    time.sleep(0.5)
                    screen.shot("marked")
                before = session.state["key"]
                screen.do("key", "n")
                session.wait(lambda s, before=before: s["key"] != before, "the next photograph")
        print(f"{len(offs)} marks by mouse, at most {max(offs):.2f} px off", flush=True)
        session.pick("G1")
        before_adjusting = mean(session.state["offsets"])
        x, y, w, h = session.state["buttons"]["adjust"]
        screen.click(x + 20, y + h / 2)
        session.wait(lambda s: s["busy"], "the adjustment begun", 20)
        time.sleep(1)
        screen.shot("adjusting")
        state = session.wait(lambda s: s["residuals"] and not s["busy"], "residuals", 400)
        time.sleep(1)
        screen.shot("adjusted")
        print(state["verdict"])
        used = {k: v for k, v in state["residuals"].items() if v[0] is not None}
        if len(used) != 5 or any(v[2] != "good" for v in used.values()):
            raise SystemExit(f"The residuals are not what they should be: {used}")
        after = mean(state["offsets"])
        print(f"marks lay {before_adjusting:.2f} px from where they should on average, {after:.2f} px after the adjustment")
        if not after < before_adjusting:
            raise SystemExit("The adjustment did not bring marks and points together.")
        x, y, w, h = state["buttons"]["show_map"]
        screen.click(x + w / 2, y + h / 2)
        session.wait(lambda s: len(s["layers"]) >= 6 and not s["busy"], "the survey in the map", 120)
        time.sleep(3)
        screen.shot("map")
    finally:
        screen.close()
    return 0


if __name__ == "__main__":
    sys.exit(main())
