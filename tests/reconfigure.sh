#!/bin/sh
# A build that is configured anew, as when MPICH arrives between ./quickstart and ./quickstart check: objects follow
# the configuration, and what it does not touch is not compiled again.
set -u
top=$(cd "${srcdir:-$(dirname "$0")/..}" && pwd)
. "$top/tests/lib.sh"
if ! pkg-config --exists mpich 2>/dev/null; then
    skip 'objects follow the configuration' 'no MPICH'
    finish
fi
enter

parallel=src/par/librextract_train_la-ranks.o
plain=src/base/names.o
# What does not change is looked up once: in the file of a cache, which holds for the same flags alone.
configured() {
    "$top/configure" --cache-file=cache --enable-dependency-tracking --disable-shared "$@" >log 2>&1 &&
        make "${parallel%.o}.lo" "${plain%.o}.lo" >>log 2>&1
}
has_mpi() { nm "$parallel" | grep -q ' U MPI_Init_thread'; }

configured --without-mpi && ! has_mpi
result 'an object without MPI' $? log
touch before
sleep 1
configured && has_mpi
result 'the same object once MPI has arrived' $? log
[ -z "$(find "$plain" -newer before)" ]
result 'what MPI does not touch is not compiled again' $? log
touch before
sleep 1
configured && [ -z "$(find "$parallel" "$plain" -newer before)" ]
result 'the same configuration compiles nothing' $? log
touch before
sleep 1
rm cache
configured --without-mpi CFLAGS=-O1 && ! has_mpi && [ -n "$(find "$plain" -newer before)" ]
result 'MPI has gone, and other compiler flags compile all' $? log
finish
