#!/usr/bin/env python3
"""Seeds: below 1000 to try and to choose by, from 1000 on final ones.

    ledger.py claim EXPERIMENT FOLDER SEED [SEED ...] [-KEYWORD VALUE ...]
    ledger.py list

Skies of a final seed judge what is committed, and no choice is made on them: each is run once in an experiment, by a commit
without changes, with the settings of the commit. final_seeds.tsv says which were run, and by which commit; the scripts of this
folder ask here before they make a sky, and stop where a final seed was used before, where files differ from the commit, or
where keywords of the command line change what is judged. A run that was interrupted goes on in its folder.

Training has no part in this: its skies are other ones whatever the seed (rextract-train, rextract-validate and rextract-simulate
have streams of random numbers of their own)."""
import json
import os
import subprocess
import sys
from pathlib import Path

FINAL = 1000
LEDGER = Path(os.environ.get("RX_LEDGER", Path(__file__).resolve().parent / "final_seeds.tsv"))
FREE = {"NTHREADS", "SHARD", "MERGE", "QA_FIGURES", "VERBOSE_TYPE"}  # these change no result


def rows():
    return [line.split("\t") for line in LEDGER.read_text().splitlines()[1:]]


def git(*arguments):
    done = subprocess.run(["git", *arguments], cwd=LEDGER.parent, capture_output=True, text=True)
    if done.returncode:
        sys.exit(f"ledger: git {arguments[0]} fails ({done.stderr.strip()}); a final seed needs the repository, for the commit that it judges")
    return done.stdout.rstrip("\n")


def store(folder, name, text, result=None):
    """NAME.md, and NAME.json where there is a result, into the folder of an experiment."""
    with open(f"{folder}/{name}.md", "w") as file:
        file.write("\n".join(text) + "\n")
    if result is not None:
        with open(f"{folder}/{name}.json", "w") as file:
            json.dump(result, file, indent=1, default=float)
            file.write("\n")
    print("\n".join(text))


def claim(experiment, folder, seeds, keywords=()):
    """Stops where a final seed may not be run; otherwise it is run from now on, by the commit of the sources."""
    final = sorted({int(s) for s in seeds if int(s) >= FINAL})
    if not final:
        return
    if os.environ.get("RX_ARGUMENTS"):
        sys.exit(f"ledger: RX_ARGUMENTS changes what is judged; a final seed ({final[0]}) is run with the settings of the commit")
    changed = [k.lstrip("-") for k in keywords if k.startswith("-") and k.lstrip("-") not in FREE | {"SEED"}]
    if changed:
        sys.exit(f"ledger: -{changed[0]} changes what is judged; a final seed ({final[0]}) is run with the settings of the commit: choose by a seed "
                 f"below {FINAL}")
    folder = Path(folder)
    mark, commit = folder / "final-seeds", git("rev-parse", "HEAD")
    mine = mark.read_text().splitlines() if mark.exists() else []
    edited = [line[3:] for line in git("status", "--porcelain", "--untracked-files=no", ":/").splitlines() if not line.endswith(LEDGER.name)]
    if edited:
        sys.exit(f"ledger: {edited[0]} differs from the commit; commit it first: a final seed ({final[0]}) is run once, by a commit")
    for seed in final:
        used = next((r for r in rows() if r[:2] == [experiment, str(seed)]), None)
        if used and f"{experiment} {seed} {used[2]}" not in mine:
            sys.exit(f"ledger: {experiment} was run with final seed {seed} by commit {used[2]}; take the next one, or one below {FINAL} to choose by")
        if used and used[2] != commit:
            sys.exit(f"ledger: {folder} was begun by commit {used[2]}, this is {commit}; go on with that one")
        if not used:
            folder.mkdir(parents=True, exist_ok=True)
            with LEDGER.open("a") as ledger:
                ledger.write(f"{experiment}\t{seed}\t{commit}\n")
            mine.append(f"{experiment} {seed} {commit}")
            mark.write_text("\n".join(mine) + "\n")


if __name__ == "__main__":
    if sys.argv[1:] == ["list"]:
        print(LEDGER.read_text(), end="")
    elif len(sys.argv) < 5 or sys.argv[1] != "claim":
        sys.exit(__doc__)
    else:
        numbers = [a for a in sys.argv[4:] if a.isdigit()]
        claim(sys.argv[2], sys.argv[3], numbers, sys.argv[4:])
