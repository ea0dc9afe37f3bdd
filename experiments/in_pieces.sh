#!/usr/bin/env bash
# A training in sessions of limited length, on machines that keep nothing in between and pass on small files alone.
#
#   experiments/in_pieces.sh PARTS MINUTES OVERRIDE…
#
# Joins the checkpoint that lies in PARTS, makes the data where it is missing, trains for so many minutes and leaves in
# PARTS the checkpoint in pieces of 15 MiB, or, once the training has ended, its weights and training.json. PYTHON names
# the interpreter. R4 as published, in three sessions of ten minutes on one H200 (estimated, not measured):
#
#   experiments/in_pieces.sh parts 8.5 method=m1 run=m1_r4 data=paper trainer=gpu train.batch_size=128 train.compile=true
set -euo pipefail
parts=$1 minutes=$2
shift 2
python=${PYTHON:-python}
training=$parts/training
mkdir -p "$training" "$parts"
# A session that was cut off while it wrote leaves pieces without the mark; they are of no use.
if [ -f "$parts/whole" ]; then
    cat "$parts"/last.ckpt.* > "$training/last.ckpt"
    (cd "$training" && sha256sum --check --quiet ../whole)
fi
for file in settings.json training.json weights.safetensors; do
    if [ -f "$parts/$file" ]; then cp "$parts/$file" "$training/"; fi
done
data=()
for word in "$@"; do
    case $word in data=* | data.benchmark* | data.root=*) data+=("$word") ;; esac
done
"$python" -m symshrec generate "${data[@]}" workers="$(nproc)"
"$python" -m symshrec train "$@" train.max_minutes="$minutes" train.folder="$training"
rm -f "$parts/whole" "$parts"/last.ckpt.*
if [ -f "$training/training.json" ]; then
    cp "$training"/{settings.json,training.json,weights.safetensors} "$parts/"
    echo "ended: $parts/weights.safetensors"
else
    cp "$training/settings.json" "$parts/"
    split --bytes=15MiB --numeric-suffixes --suffix-length=3 "$training/last.ckpt" "$parts/last.ckpt."
    (cd "$training" && sha256sum last.ckpt > ../whole)
    echo "to go on: the same command with $parts"
fi
rm -rf "$training"
