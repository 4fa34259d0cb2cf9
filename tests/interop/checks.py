"""Checks that are counted and runs of the program, for the scripts beside this one."""

import subprocess

passed = failed = 0


def check(name, holds, detail=""):
    global passed, failed
    if holds:
        passed += 1
    else:
        failed += 1
        print(f"FAILED {name}: {detail}")


def outcome():
    """Prints the counts; gives the exit code."""
    print(f"{passed} passed, {failed} failed")
    return 1 if failed else 0


def ivd(program, *arguments):
    words = [program, *map(str, arguments), "--progress", "never", "--cache", "off"]
    done = subprocess.run(words, capture_output=True, text=True)
    if done.returncode != 0:
        raise RuntimeError(f"ivd {' '.join(map(str, arguments))}: exit {done.returncode}: {done.stderr.strip()}")
