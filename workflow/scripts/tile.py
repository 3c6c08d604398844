"""One tile. The program is called with words: no shell sees a name."""
import os
import subprocess
import sys

sys.path.insert(0, os.path.join(os.path.dirname(snakemake.scriptdir), "scripts"))
import tiles as listed

OWN_REASONS = (0, 3, 5, 6, 10)  # exit codes that another try would not change: fine, or the tile's own fault
params = snakemake.params
one = listed.Tile(params.line, params.name)
for folder in ("catalogs", "records", "reports", "logs"):
    os.makedirs(folder, exist_ok=True)
record = os.path.join("records", one.name + ".record")
if os.path.exists(record):
    os.unlink(record)
command = [params.program, *listed.arguments(one, params.settings, params.options, snakemake.threads)]
with open(os.path.join("logs", one.id + ".log"), "w", encoding="utf-8") as log:
    code = subprocess.run(command, stdin=subprocess.DEVNULL, stderr=log, check=False).returncode
again = code not in OWN_REASONS and snakemake.resources.attempt <= params.retries
if code == 2 or again or not os.path.exists(record):
    what = "a keyword is wrong" if code == 2 else "no record" if not again else "it is tried again"
    sys.exit(f"{command[1]}: rextract ended with {code}, {what}; see logs/{one.id}.log")
