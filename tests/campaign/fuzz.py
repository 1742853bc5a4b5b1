"""Fuzzed calls of the Python interface: ``python -m campaign.fuzz --seconds 600``, in the folder of tests.

Hypothesis draws a call of ``calls.EVERY`` and some strange values; each value is then given to every argument, and pairs of them
to pairs of arguments: hundreds of calls by one example. The calls are made in a process of their own, so that a crash is seen and
is reported with the call that made it. What is found goes to a file, from where it may go to ``corpus.json``, which
test_campaign.py tries in every run.
"""

import argparse
import json
import os
import random
import resource
import subprocess
import sys
import time
from collections import Counter
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from hypothesis import HealthCheck, Phase, given, seed, settings
from hypothesis import strategies as st

from . import calls, oracle
from .recipes import Recipe, build, recipes, shown

#: So many values of an example, and pairs of strange arguments.
VALUES, PAIRS = 12, 1500

#: The most calls of an example, and the seconds of the CPU that it may take.
CALLS_OF_EXAMPLE, SECONDS_OF_EXAMPLE = 2000, 0.05

#: Of calls that ask for work, one in so many may take a second.
PATIENCE = 100

#: The most memory of the process, in bytes: what asks for more is refused, or NumPy says so.
MEMORY = 3 << 30

Example = tuple[str, list[Recipe], int]

#: A call: its name and recipes for some of its arguments.
Call = tuple[str, dict[str, Recipe]]


def examples() -> st.SearchStrategy[Example]:
    """A call, strange values for it, and what the pairs are drawn with."""
    return st.tuples(
        st.sampled_from(sorted(calls.EVERY)), st.lists(recipes(), min_size=1, max_size=VALUES), st.integers(0, 2**32)
    )


def variations(example: Example) -> list[Call]:
    """The calls of an example: each value for each argument, then pairs."""
    name, values, number = example
    arguments = list(calls.EVERY[name][1])
    every: list[Call] = [(name, {argument: value}) for value in values for argument in arguments]
    draw = random.Random(number)
    if len(arguments) > 1:
        for _ in range(PAIRS):
            every.append((name, {argument: draw.choice(values) for argument in draw.sample(arguments, 2)}))
    draw.shuffle(every)
    return every


def make(timer: oracle.Timer, call: Call, patient: bool = False) -> oracle.Outcome:
    """Make one call."""
    name, changed = call
    function, right = calls.EVERY[name]
    arguments = dict(right)
    for argument, recipe in changed.items():
        arguments[argument] = build(recipe, right[argument])
    seconds = oracle.ASKED if changed.keys() & calls.WORK and not patient else oracle.ENOUGH
    return oracle.judged(timer, function, arguments, changed, seconds)


class Tally:
    """What was tried, how often, and what was found."""

    def __init__(self) -> None:
        self.kinds: Counter[str] = Counter()
        self.names: Counter[str] = Counter()
        self.found: dict[str, dict[str, Any]] = {}

    def add(self, call: Call, outcome: oracle.Outcome) -> None:
        """One call more."""
        self.kinds[outcome.kind] += 1
        self.names[call[0]] += 1
        if outcome.kind == "failed":
            key = f"{call[0]}: {outcome.place}"
            if key in self.found:
                self.found[key]["times"] += 1
            else:
                self.found[key] = {"call": call, "text": outcome.text, "times": 1}

    def as_dict(self) -> dict[str, Any]:
        """For a file."""
        peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
        return {
            "kinds": self.kinds,
            "names": self.names,
            "found": self.found,
            "peak_kilobytes": peak,
            "kilobytes": resident(),
            "cpu": time.process_time(),
        }


def resident() -> int:
    """The memory of this process, in kilobytes."""
    try:
        return int(Path("/proc/self/statm").read_text().split()[1]) * resource.getpagesize() // 1024
    except OSError:  # not this kind of system
        return 0


def work(seconds: float, number: int, folder: Path) -> None:
    """Make calls for so long; what comes next is written down first, what was found last."""
    oracle.quiet()
    if hasattr(resource, "RLIMIT_AS"):
        resource.setrlimit(resource.RLIMIT_AS, (MEMORY, MEMORY))
    os.chdir(calls.FOLDER)
    tally, until, written = Tally(), time.monotonic() + seconds, time.monotonic()
    draw = random.Random(number)
    with oracle.Timer() as timer:

        @seed(number)
        @settings(
            max_examples=10**9, deadline=None, database=None, suppress_health_check=list(HealthCheck), phases=[Phase.generate]
        )
        @given(examples())
        def go_on(example: Example) -> None:
            nonlocal written
            if time.monotonic() > until:
                raise _EnoughError
            (folder / "now.json").write_text(json.dumps(example))
            begin = time.process_time()
            for call in variations(example)[:CALLS_OF_EXAMPLE]:
                tally.add(call, make(timer, call, draw.randrange(PATIENCE) == 0))
                if time.process_time() - begin > SECONDS_OF_EXAMPLE:
                    break
            if time.monotonic() > written + 5.0:
                written = time.monotonic()
                _write(folder / "tally.json", tally)

        try:
            go_on()
        except _EnoughError:
            pass
        finally:
            _write(folder / "tally.json", tally)


class _EnoughError(BaseException):
    """The time is over."""


def _write(path: Path, tally: Tally) -> None:
    beside = path.with_suffix(".new")
    beside.write_text(json.dumps(tally.as_dict()))
    beside.replace(path)


#: A process of calls ends after so many seconds, so that its memory and its caches begin anew.
SHIFT = 240.0

#: An example that takes so many seconds of the CPU hangs, and so does a process that has begun no other for so many seconds.
HANGS, SILENCE = 20.0, 900.0


def campaign(seconds: float, number: int, report: Path) -> dict[str, Any]:
    """Processes of calls, one after the other, until the time is over."""
    total: dict[str, Any] = {"calls": 0, "seconds": 0.0, "kinds": Counter(), "names": Counter(), "found": {}, "peak_kilobytes": 0}
    begin = time.monotonic()
    while (left := seconds - (time.monotonic() - begin)) > 1.0:
        with TemporaryDirectory() as place:
            folder = Path(place)
            ended = _shift(min(left, SHIFT), number, folder)
            if (folder / "tally.json").exists():
                part = json.loads((folder / "tally.json").read_text())
                for name in ("kinds", "names"):
                    total[name] += Counter(part[name])
                for key, each in part["found"].items():
                    known = total["found"].setdefault(key, each | {"times": 0})
                    known["times"] += each["times"]
                total["cpu_seconds"] = total.get("cpu_seconds", 0.0) + part["cpu"]
                total["peak_kilobytes"] = max(total["peak_kilobytes"], part["peak_kilobytes"])
            if ended:
                example = json.loads((folder / "now.json").read_text()) if (folder / "now.json").exists() else None
                total["found"][f"process {number}: {ended}"] = {"call": _culprit(example), "text": ended, "times": 1}
        number += 1
        total["calls"], total["seconds"] = sum(total["kinds"].values()), time.monotonic() - begin
        report.write_text(json.dumps(total, indent=1))
        print(
            f"{total['calls']:,} calls in {total['seconds']:.0f} s, {len(total['found'])} found: {dict(total['kinds'])}",
            flush=True,
        )
    return total


def _shift(seconds: float, number: int, folder: Path) -> str:
    """One process of calls; how it ended if not as it should."""
    here = Path(__file__).parent.parent
    words = [sys.executable, "-X", "faulthandler", "-m", "campaign.fuzz", "--shift", str(folder), "--seed", str(number)]
    process = subprocess.Popen([*words, "--seconds", str(seconds)], cwd=here, stderr=subprocess.PIPE, text=True)
    example, used = time.time(), 0.0
    while True:
        try:
            _, wrong = process.communicate(timeout=5.0)
        except subprocess.TimeoutExpired:
            now = folder / "now.json"
            begun = now.stat().st_mtime if now.exists() else example
            if begun != example:
                example, used = begun, _seconds_used(process.pid)
            # On a busy machine a second of the CPU may take minutes.
            if _seconds_used(process.pid) - used > HANGS or time.time() - example > SILENCE:
                break
            continue
        return "" if process.returncode == 0 else f"ended with {process.returncode}: {wrong[-2000:]}"
    process.kill()
    process.communicate()
    return "hung"


def _seconds_used(process: int) -> float:
    """Of the CPU, by another process."""
    fields = Path(f"/proc/{process}/stat").read_text().rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


def _culprit(example: Any) -> Any:
    """The call of an example that ends its process: its calls are made again, each written down before it is made."""
    if example is None:
        return None
    with TemporaryDirectory() as place:
        folder = Path(place)
        (folder / "now.json").write_text(json.dumps(example))
        words = [sys.executable, "-m", "campaign.fuzz", "--replay", place]
        try:
            done = subprocess.run(words, cwd=Path(__file__).parent.parent, capture_output=True, timeout=SILENCE)
        except subprocess.TimeoutExpired:
            pass
        else:
            if done.returncode >= 0:
                return example
        return json.loads((folder / "call.json").read_text())


def replay(folder: Path) -> None:
    """The calls of an example again, each written down before it is made."""
    oracle.quiet()
    with oracle.Timer() as timer:
        for call in variations(json.loads((folder / "now.json").read_text())):
            (folder / "call.json").write_text(json.dumps(call))
            make(timer, call)


def once(call: Call) -> oracle.Outcome:
    """One call, as in a campaign."""
    oracle.quiet()
    with oracle.Timer() as timer:
        return make(timer, call, patient=True)


def in_words(call: Call) -> str:
    """A call in words."""
    name, changed = call
    right = calls.EVERY[name][1]
    return f"{name}({', '.join(f'{argument}={shown(build(recipe, right[argument]))}' for argument, recipe in changed.items())})"


def main() -> None:
    """The command."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seconds", type=float, default=60.0)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--report", type=Path, default=Path("found.json"))
    parser.add_argument("--shift", type=Path, help="for itself: make calls in this process")
    parser.add_argument("--replay", type=Path, help="for itself: make the calls of an example again")
    parser.add_argument("--call", type=json.loads, help="make one call, which is given as a report has it")
    args = parser.parse_args()
    if args.call is not None:
        print(in_words(args.call), once(args.call))
    elif args.replay is not None:
        replay(args.replay)
    elif args.shift is not None:
        work(args.seconds, args.seed, args.shift)
    else:
        total = campaign(args.seconds, args.seed, args.report)
        for key, each in total["found"].items():
            print(f"- {key}, {each['times']} times: {each['text'][:300]}\n  {json.dumps(each['call'])[:500]}")
        sys.exit(bool(total["found"]))


if __name__ == "__main__":
    main()
