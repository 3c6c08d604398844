"""The benchmark: stages.py measures, table.py writes; run.sh is how to call it."""
import argparse
import os
import signal
import sys
import tempfile

import machine
import stages
import table


def parse():
    parser = argparse.ArgumentParser(prog="bench.py")
    parser.add_argument("--size", choices=("quick", "full"), required=True)
    parser.add_argument("--only", help="a comma separated list of parts: " + ", ".join(stages.PARTS))
    parser.add_argument("--repeats", type=int, help="in place of the size's own number")
    parser.add_argument("--largest", type=int, default=16384, help="side of the largest tile")
    parser.add_argument("--layers", action="store_true", help="show each layer of the network")
    for name in ("build", "top", "out"):
        parser.add_argument("--" + name, type=os.path.abspath, required=True)
    return parser.parse_args()


def measure(bench, wanted, save):
    """Each part, one after the other; what is there so far is saved after each, so that a run cut short keeps it.
    Returns what was wrong with the figure."""
    trouble = None
    bench.prepare()
    for name in wanted:
        group, part = stages.PARTS[name]
        bench.box.say(f"bench: {group}")
        bench.begin(group)
        try:
            part(bench)
        except machine.Failed as error:
            bench.skip(f"the rest of “{group}”: {error}")
        trouble = save(bench)
    return trouble


def save(bench, arguments):
    head = {"size": arguments.size, "processor": machine.processor_name(), "cores": bench.box.most,
            "missing": bench.missing, "skipped": bench.skipped, "limits": bench.limits}
    trouble = table.draw(arguments.out, bench.rows) if bench.rows else None
    table.write_json(os.path.join(arguments.out, "bench.json"), head, bench.rows)
    table.write_markdown(os.path.join(arguments.out, "bench.md"), head, bench.rows, bench.extras,
                         [group for group, _ in stages.PARTS.values()])
    return trouble


def main():
    arguments = parse()
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(143))
    # Tiles are large: not into /tmp, which may be memory.
    with tempfile.TemporaryDirectory(prefix="tiles-", dir=arguments.out) as work:
        bench = stages.Bench(machine.Machine(arguments.top, arguments.build, work), arguments.size, arguments.layers,
                             arguments.repeats, arguments.largest)
        wanted = ["limits"] + arguments.only.split(",") if arguments.only else list(stages.PARTS)
        try:
            trouble = measure(bench, wanted, lambda one: save(one, arguments))
        except machine.Failed as error:
            sys.exit(f"bench.py: {error}")
    if trouble:
        print(f"bench.py: no figure: {trouble}", file=sys.stderr)
    with open(os.path.join(arguments.out, "bench.md"), encoding="utf-8") as file:
        print(file.read(), end="")


if __name__ == "__main__":
    main()
