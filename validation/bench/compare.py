"""Has anything become slower, or larger, beside what it is compared with?

    compare.py COMMITTED NEW        two files bench.json of the same size of the benchmark

Ratios alone, never seconds. A row has fallen when the median of its new ratios is below 0.9 of the committed one, and
their better quartile, too: else it may be luck. Exit 1 when one has, 3 when the files cannot be compared.
"""
import json
import sys

LEAST = 0.9


def read(name):
    try:
        with open(name, encoding="utf-8") as file:
            content = json.load(file)
        rows = {row["key"]: row for row in content["rows"] if row["compared"]}
        if not all(len(row["ratio"]) == 3 for row in rows.values()):
            raise ValueError("a ratio is not three numbers")
        return content["size"], rows
    except (OSError, ValueError, KeyError, TypeError) as error:
        print(f"compare.py: {name}: no results of the benchmark ({error}); make them by validation/bench/run.sh",
              file=sys.stderr)
        sys.exit(3)


def compare(old, new):
    """Lines to print, and how many rows have fallen."""
    lines, fallen = [], 0
    for key, row in old.items():
        if key not in new:
            lines.append(f"not measured: {row['what']}")
            continue
        before, (_, middle, better) = row["ratio"][1], new[key]["ratio"]
        if middle < LEAST * before and better < LEAST * before:
            fallen += 1
            lines.append(f"FELL to {100 * middle / before:.0f} %: {row['what']}: {before:.3g} committed, "
                         f"now {middle:.3g} ({better:.3g} at the better quartile)")
    return lines, fallen


def main():
    if len(sys.argv) != 3:
        print("usage: compare.py COMMITTED NEW", file=sys.stderr)
        sys.exit(2)
    (size, old), (new_size, new) = read(sys.argv[1]), read(sys.argv[2])
    common = [key for key in old if key in new]
    if size != new_size or not common:
        print(f"compare.py: {sys.argv[2]}: a {new_size} run with {len(common)} rows in common with a {size} run; run "
              "the same size", file=sys.stderr)
        sys.exit(3)
    lines, fallen = compare(old, new)
    for line in lines:
        print(line)
    print(f"{len(common)} ratios compared, {fallen} fell by more than 10 %")
    sys.exit(1 if fallen else 0)


if __name__ == "__main__":
    main()
