#!/bin/sh
# The main job on the simulated tile: what it finds is held against the truth by quality gates, and no byte
# of any output depends on the number of threads.
set -u
top=$(cd "${srcdir:-$(dirname "$0")/..}" && pwd)
. "$top/tests/lib.sh"
program=$programs/rextract
need rextract
enter

# run FOLDER THREADS ARGUMENT...: the job with all its outputs in FOLDER, what it says in FOLDER.log.
run() {
    folder=$1 threads=$2
    shift 2
    mkdir "$folder"
    # glibc fills fresh memory with MALLOC_PERTURB_: what was not set first would show as other bytes
    (cd "$folder" && MALLOC_PERTURB_=$((threads * 80)) "$program" "$top/tests/data/sim.fits.fz" -NTHREADS "$threads" \
        -c "$top/config/default.sex" -PARAMETERS_NAME "$top/config/default.param" \
        -FILTER_NAME "$top/config/default.conv" -RESTORE_TYPE NONE,RL -PSF_TYPE AUTO -MAG_ZEROPOINT 25 \
        -CATALOG_NAME sim.cat -CATALOG_TYPE FITS_LDAC \
        -CHECKIMAGE_TYPE RESTORED,RESIDUAL,SEGMENTATION \
        -CHECKIMAGE_NAME restored.fits,residual.fits,segments.fits \
        -REFERENCE_NAME "$top/tests/data/sim_truth.fits" -QA_NAME qa "$@") 2>"$folder.log"
}

# Limits well outside what is found: a gate passes only when its whole interval lies within.
cat >truth.qa <<'END'
recall     13:16  >= 0.8
recall     13:17  >= 0.8
precision  all    >= 0.8
bias_mag   13:17  in -0.1:0.1
dx         13:17  in -0.15:0.15
dy         13:17  in -0.15:0.15
END
run one 1 -QA_GATES ../truth.qa
result "the truth's gates pass" $? one.log
run two 2 -QA_GATES ../truth.qa
diff -r one two >difference 2>&1
result "two threads give the bytes of one" $? difference

echo "recall all >= 0.999" >false.qa
run false 2 -QA_GATES ../false.qa
[ $? -eq 5 ]
result "a gate that cannot hold ends with 5" $? false.log

echo "recall 13:14 >= 0.9" >few.qa
run few 2 -QA_GATES ../few.qa
[ $? -eq 6 ]
result "a gate with too few sources ends with 6" $? few.log

finish
