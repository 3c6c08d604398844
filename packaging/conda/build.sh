#!/bin/bash
# What conda-build runs in the recipe's sources: sep's C library, then Rextract, into $PREFIX.
set -euo pipefail
cmake -S sep -B sep/build -DCMAKE_INSTALL_PREFIX="$PREFIX" -DCMAKE_INSTALL_LIBDIR=lib -DCMAKE_BUILD_TYPE=Release
cmake --build sep/build --target install
autoreconf -i
./configure --prefix="$PREFIX" CPPFLAGS="-I$PREFIX/include ${CPPFLAGS:-}" LDFLAGS="-L$PREFIX/lib ${LDFLAGS:-}"
make -j"${CPU_COUNT:-2}"
make install
