"""The table of models.sh: every model beside the first one, on the same test scenes.

    models.py NAME ...   inside models.sh's folder, which has a folder of each name; the first is the base

Writes models.md. Differences and their significance are those of ablation.py.
"""
import re
import sys

from ablation import gather, lines, quality, verdicts


def cost(name):
    with open(f"{name}/info.txt", encoding="utf-8") as file:
        info = file.read()
    stages = re.findall(r"^(?:RESTORE|SECOND) .* (\d+) parameters, ([\d.]+) thousand multiplications per pixel, reaches (\d+) pixels", info, re.M)
    return {
        "digest": re.search(r"digest (\w+)", info)[1],
        "images": int(re.search(r"(\d+) images", info)[1]),
        "kmac": sum(float(kmac) for _, kmac, _ in stages),
        "parameters": sum(int(parameters) for parameters, _, _ in stages),
        "reach": sum(int(reach) for _, _, reach in stages),
        "steps": max(1, len(stages)) * int((re.search(r"Richardson-Lucy steps with the tile's PSF: (\d+)", info) or (0, 0))[1]),
    }


def report(rows, base):
    yield "# Models beside each other"
    yield ""
    yield (f"In brackets: difference to {base}, paired over the same scenes, seeings or sets of stars; \\* \\*\\* \\*\\*\\*: "
           "p < 0.05, 0.01, 0.001, adjusted by Holm for the number of models.")
    yield ""
    yield from lines(
        ["model", "digest", "training images", "thousand MAC per pixel", "parameters", "reaches (pixels)",
         "Richardson-Lucy steps", "checkerboard (sigma)"],
        ([r["title"], r["digest"], str(r["images"]), f"{r['kmac']:.1f}", str(r["parameters"]), str(r["reach"]),
          str(r["steps"]), f"{r['checkerboard']:.2g}"] for r in rows.values()))
    yield from quality(rows, "model")
    yield "Checkerboard: largest difference between phases on a bright plateau."
    yield ""
    yield "## Read"
    yield ""
    yield "A difference counts where p < 0.05 after Holm."
    yield ""
    yield from verdicts(rows, base, [name for name in rows if name != base])


def main():
    names = sys.argv[1:]
    rows = gather([(name, name) for name in names], cost)
    with open("models.md", "w", encoding="utf-8") as file:
        file.write("\n".join(report(rows, names[0])))


if __name__ == "__main__":
    main()
