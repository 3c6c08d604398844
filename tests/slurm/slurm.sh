#!/bin/bash
# A Slurm of one machine, for tests: slurm.sh start|stop|kill-node|restart-node|restart-controller FOLDER
#
# Its three daemons (munged, slurmctld, slurmd) run as whoever calls, and all that is theirs lies in FOLDER, the key of
# munge too: a Slurm or a munge of the machine's own is not touched. Clients need SLURM_CONF=FOLDER/slurm.conf.
# FOLDER's path must be short: it holds a socket.
set -euo pipefail
PATH=$PATH:/usr/sbin:/sbin
folder=$(realpath -m "$2")
export SLURM_CONF=$folder/slurm.conf

# Two ports that nobody has, near a number of this process.
free_ports() {
    local port=$((20000 + $$ % 20000))
    while ss -Htnl 2>/dev/null | grep -qE ":($port|$((port + 1)))\b"; do port=$((port + 2)); done
    echo "$port"
}

configure() {
    local port name user
    port=$(free_ports) name=$(hostname -s) user=$(id -un)
    mkdir -p "$folder"/{state,spool,log,run}
    (umask 077 && head -c 128 /dev/urandom >"$folder/key")
    # Slurm wants a sixteenth of the memory for itself and for us.
    cat >"$SLURM_CONF" <<END
ClusterName=test
SlurmctldHost=$name(127.0.0.1)
SlurmctldPort=$port
SlurmdPort=$((port + 1))
SlurmUser=$user
SlurmdUser=$user
AuthType=auth/munge
AuthInfo=socket=$folder/run/munge
CredType=cred/munge
ProctrackType=proctrack/linuxproc
TaskPlugin=task/none
SelectType=select/cons_tres
SelectTypeParameters=CR_Core_Memory
MpiDefault=none
ReturnToService=2
StateSaveLocation=$folder/state
SlurmdSpoolDir=$folder/spool
SlurmctldPidFile=$folder/run/slurmctld.pid
SlurmdPidFile=$folder/run/slurmd.pid
SlurmctldLogFile=$folder/log/slurmctld.log
SlurmdLogFile=$folder/log/slurmd.log
SlurmctldTimeout=10
SlurmdTimeout=10
JobRequeue=1
MinJobAge=600
KillWait=2
SchedulerParameters=sched_interval=1,batch_sched_delay=1
NodeName=$name NodeAddr=127.0.0.1 CPUs=$(nproc) RealMemory=$(awk '/MemTotal/ {print int($2 / 1100)}' /proc/meminfo) State=UNKNOWN
PartitionName=all Nodes=ALL Default=YES MaxTime=INFINITE State=UP
END
}

wait_for() {
    for _ in $(seq 120); do
        "$@" >/dev/null 2>&1 && return
        sleep 0.5
    done
    echo "slurm.sh: waited in vain for: $*" >&2
    tail -n 5 "$folder"/log/* >&2
    exit 1
}

munge_started() {
    munged --force --key-file="$folder/key" --socket="$folder/run/munge" --pid-file="$folder/run/munged.pid" \
        --log-file="$folder/log/munged.log" --seed-file="$folder/state/munge.seed" 2>>"$folder/log/munged.log"
    wait_for munge -n --socket="$folder/run/munge"
}

node_idle() {
    sinfo -h -t idle,mix,alloc -o %n | grep -q .
}

# end DAEMON SIGNAL: and wait until it is gone
end() {
    local pid
    pid=$(cat "$folder/run/$1.pid" 2>/dev/null) || return 0
    kill "-$2" "$pid" 2>/dev/null || return 0
    for _ in $(seq 200); do
        kill -0 "$pid" 2>/dev/null || return 0
        sleep 0.1
    done
    kill -KILL "$pid" 2>/dev/null || true
}

# As a machine that loses its power: the daemon, and everything that it started.
kill_node() {
    local step session
    end slurmd KILL
    for step in $(pgrep slurmstepd); do
        grep -qzFx "SLURM_CONF=$SLURM_CONF" "/proc/$step/environ" 2>/dev/null || continue
        mapfile -t session < <(ps -o pid= -s "$(ps -o sid= -p "$step" | tr -d ' ')")
        kill -KILL "${session[@]}" 2>/dev/null || true
    done
}

case $1 in
start)
    configure
    munge_started
    slurmctld
    slurmd
    wait_for node_idle
    ;;
kill-node)
    kill_node
    ;;
restart-node)
    slurmd
    ;;
restart-controller) # in good order: one that is killed forgets the last seconds, and drains a node that runs what it forgot
    end slurmctld TERM
    slurmctld
    wait_for sinfo
    ;;
stop)
    kill_node
    end slurmctld TERM
    end munged TERM
    ;;
*)
    echo "slurm.sh: unknown order '$1'" >&2
    exit 2
    ;;
esac
