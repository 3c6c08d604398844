#!/usr/bin/python3
"""What became of a Slurm job, in Snakemake's words; without accounting, scontrol knows it for a while."""
import re
import subprocess
import sys

RUNNING = {"PENDING", "CONFIGURING", "RUNNING", "COMPLETING", "SUSPENDED", "REQUEUED", "REQUEUE_HOLD", "RESIZING",
           "SIGNALING", "STAGE_OUT", "REQUEUE_FED", "STOPPED"}
done = subprocess.run(["scontrol", "-o", "show", "job", sys.argv[1]], capture_output=True, text=True, check=False)
state = re.search(r"JobState=(\w+)", done.stdout)
if state is None:  # the controller is away, or has forgotten the job: ask again, or look at the outputs
    print("running" if "Invalid job id" not in done.stderr else "failed")
elif state.group(1) == "COMPLETED":
    print("success")
else:
    print("running" if state.group(1) in RUNNING else "failed")
