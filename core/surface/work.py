"""The levels of a surface computed, tile by tile, and what each stage costs."""

from __future__ import annotations

import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field

from ..parallel import run_calls
from ..progress import Progress
from .match import match_tile
from .mosaic import Tile
from .plan import Plan

_POOL = 4  # tiles from which on a pool of processes is worth its start
# CPU time of a cell of the finest level, and of a hypothesis of the coarsest, in cells of the levels between.
_FINEST, _HYPOTHESIS = 2.2, 0.06


@dataclass(frozen=True)
class Sharing:
    """How many processes share the work, or the address of a Dask scheduler that does it."""

    workers: int
    scheduler: str | None


@dataclass
class Stage:
    """What a stage took: seconds by the clock, seconds of the processors, the most memory of a process (MB; None: not known)."""

    name: str
    clock: float = 0.0
    processor: float = 0.0
    memory: float | None = None
    tiles: int = 0
    kept: int = 0  # tiles of an earlier run

    def add(self, processor: float, memory: float | None) -> None:
        """Count work of another process, or of this one."""
        self.processor += processor
        if memory is not None:
            self.memory = max(self.memory or 0.0, memory)


@dataclass
class Stages:
    """The stages in their order."""

    listed: list[Stage] = field(default_factory=list)

    @contextmanager
    def of(self, name: str, *, elsewhere: bool = False) -> Iterator[Stage]:
        """Measure a stage; ``elsewhere`` leaves its processors and memory to whoever calls ``add``."""
        stage = Stage(name)
        clock, processor = time.perf_counter(), time.process_time()
        yield stage
        stage.clock = time.perf_counter() - clock
        if not elsewhere:
            stage.add(time.process_time() - processor, peak_memory())
        self.listed.append(stage)


def peak_memory() -> float | None:
    """Return the most memory (MB) that this process has held so far, None where the system does not tell."""
    if sys.platform == "win32":
        return None
    import resource

    held = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    return held / (1e6 if sys.platform == "darwin" else 1e3)


def compute(plan: Plan, tile: Tile) -> tuple[bool, float, float | None]:
    """Compute a tile; return whether it was missing, the seconds of the processor, and the process's peak memory (MB)."""
    missing = not tile.path(plan.scratch).is_file()
    start = time.process_time()
    match_tile(plan, tile)
    return missing, time.process_time() - start, peak_memory()


def compute_levels(plan: Plan, cut: list[list[Tile]], sharing: Sharing, stages: Stages, progress: Progress) -> None:
    """Compute the tiles ``cut`` of each level, from coarse to fine; a level needs the one before it."""
    weights = [_weight(plan, tiles) for tiles in cut]
    done = 0.0
    for level, tiles, weight in zip(plan.levels, cut, weights, strict=True):
        part = progress.part(done / sum(weights), (done + weight) / sum(weights))
        with stages.of(f"cells of {level.cell:.3g} m", elsewhere=True) as stage:
            for _, (missing, processor, memory) in run_calls(
                compute,
                ((plan, tile) for tile in tiles),
                workers=sharing.workers if len(tiles) >= _POOL else 1,
                scheduler=sharing.scheduler,
                progress=part,
                total=len(tiles),
            ):
                stage.tiles += 1
                stage.kept += not missing
                stage.add(processor, memory)
        done += weight


def _weight(plan: Plan, tiles: list[Tile]) -> float:
    """Return about how much work tiles of a level are, those that stand already none."""
    if not tiles:
        return 1e-9
    level = tiles[0].level
    cells = sum(t.window[2] * t.window[3] for t in tiles if not t.path(plan.scratch).is_file())
    if level is plan.levels[0]:
        return 1e-9 + cells * _HYPOTHESIS * (plan.relief[1] - plan.relief[0]) / level.step
    return 1e-9 + cells * (_FINEST if level.number == 0 else 1.0)
