"""The roll-up of what is there; tiles without a record are told in it."""
import os
import subprocess
import sys

params = snakemake.params
records = [os.path.join("records", name + ".record") for name in params.names]
with open("records.list", "w", encoding="utf-8", errors="surrogateescape") as file:
    file.writelines(name + "\n" for name in records if os.path.exists(name))
command = [params.program, "@records.list", "-TILES_NAME", params.tiles, *params.options, "-OUTPUT_NAME",
           str(snakemake.output)]
sys.exit(subprocess.run(command, stdin=subprocess.DEVNULL, check=False).returncode)
