#!/usr/bin/env bash
# A SLURM cluster of this one machine, to try a sweep on before it goes to a large one. All its state, keys, sockets and
# logs among it, lies in FOLDER; a SLURM that runs here already is left alone.
#
#   apt-get install slurm-wlm munge                # Debian, Ubuntu; as root, as is all of this
#   experiments/slurm/one_node.sh start FOLDER     # a folder on a local disk, made where it is missing
#   . FOLDER/env.sh                                # now sinfo, sbatch, squeue and scancel talk to it
#   experiments/slurm/one_node.sh stop FOLDER      # ends its jobs and services; the logs stay
#   experiments/slurm/one_node.sh run FOLDER COMMAND…     # start, the command, stop
#
# CPUS (2) is how many CPUs it hands out, PORT (16817) the first of two ports that it listens on. It needs neither cgroups
# nor an accounting database: memory limits are not kept, and sacct does not answer.
set -euo pipefail

fail() {
    echo "one_node.sh: $*" >&2
    exit 2
}

configure() {
    local cpus=${CPUS:-2} port=${PORT:-16817} host
    host=$(hostname -s)
    cat >"$folder/slurm.conf" <<CONF
ClusterName=one
SlurmctldHost=$host(127.0.0.1)
SlurmctldPort=$port
SlurmdPort=$((port + 1))
SlurmUser=root
AuthType=auth/munge
AuthInfo=socket=$folder/munge.socket
StateSaveLocation=$folder/state
SlurmdSpoolDir=$folder/spool
SlurmctldPidFile=$folder/slurmctld.pid
SlurmdPidFile=$folder/slurmd.pid
SlurmctldLogFile=$folder/slurmctld.log
SlurmdLogFile=$folder/slurmd.log
ProctrackType=proctrack/linuxproc
TaskPlugin=task/none
MpiDefault=none
SelectType=select/cons_tres
SelectTypeParameters=CR_CPU
SchedulerParameters=sched_interval=1,sched_min_interval=100000,batch_sched_delay=1
SlurmdParameters=config_overrides
AccountingStorageType=accounting_storage/none
JobAcctGatherType=jobacct_gather/none
ReturnToService=2
KillWait=10
NodeName=$host NodeAddr=127.0.0.1 CPUs=$cpus State=UNKNOWN
PartitionName=one Nodes=ALL Default=YES MaxTime=INFINITE State=UP
CONF
}

start() {
    [ "$(id -u)" = 0 ] || fail "slurmd starts jobs for their users, which takes root"
    for program in munged slurmctld slurmd sinfo; do
        command -v "$program" >/dev/null || fail "there is no $program; apt-get install slurm-wlm munge"
    done
    mkdir -p "$folder"/{state,spool}
    folder=$(realpath "$folder")
    ! running || fail "$folder has a cluster that runs; stop it first"
    configure
    (umask 077 && head -c 128 /dev/urandom >"$folder/munge.key")
    munged --force --key-file="$folder/munge.key" --socket="$folder/munge.socket" --pid-file="$folder/munged.pid" \
        --log-file="$folder/munged.log" --seed-file="$folder/munge.seed"
    slurmctld -f "$folder/slurm.conf"
    slurmd -f "$folder/slurm.conf"
    for _ in $(seq 60); do
        if [ "$(SLURM_CONF=$folder/slurm.conf sinfo --noheader --format=%T 2>/dev/null)" = idle ]; then
            echo "export SLURM_CONF=$folder/slurm.conf" >"$folder/env.sh"
            echo "$(hostname -s) waits for jobs; in this shell after: . $folder/env.sh"
            return
        fi
        sleep 0.5
    done
    tail -n 5 "$folder"/slurm*.log >&2
    stop
    fail "the node is not idle after half a minute; see $folder/*.log"
}

# Whether a service of this folder runs; prints their process ids.
running() {
    local file found=1
    for file in "$folder"/{slurmd,slurmctld,munged}.pid; do
        if [ -s "$file" ] && kill -0 "$(cat "$file")" 2>/dev/null; then
            cat "$file"
            found=0
        fi
    done
    return $found
}

stop() {
    export SLURM_CONF=$folder/slurm.conf
    timeout 20 scancel --quiet --user=root 2>/dev/null || true
    for _ in $(seq 40); do
        [ -n "$(timeout 5 squeue --noheader 2>/dev/null)" ] || break
        sleep 0.5
    done
    local pid
    for pid in $(running); do kill "$pid" 2>/dev/null || true; done
    for _ in $(seq 40); do
        running >/dev/null || return 0
        sleep 0.25
    done
    fail "still running: $(running | tr '\n' ' ')"
}

usage="usage: one_node.sh start FOLDER | stop FOLDER | run FOLDER COMMAND…"
[ $# -ge 2 ] || fail "$usage"
word=$1 folder=$2
shift 2
case $word:$# in
    start:0) start ;;
    stop:0)
        [ -f "$folder/slurm.conf" ] || fail "$folder holds no cluster"
        folder=$(realpath "$folder")
        stop
        ;;
    run:[1-9]*)
        start
        trap stop EXIT
        SLURM_CONF=$folder/slurm.conf "$@"
        ;;
    *) fail "$usage" ;;
esac
