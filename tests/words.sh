#!/bin/sh
# The glossary's old words (CONTRIBUTING.md, those in bold) stand in no text that a user or a caller reads: headers,
# strings of the sources, keywords and columns, manual pages, documents. Says file:line of each.
set -u
cd "${srcdir:-$(dirname "$0")/..}" || exit 2
scratch=$(mktemp -d) || exit 2
trap 'rm -rf "$scratch"' EXIT

sed -n '/^| old word/,/^$/s/^| \([^|]*\)|.*/\1/p' CONTRIBUTING.md | grep -o '\*\*[^*]*\*\*' | tr -d '*' >"$scratch/words"
[ -s "$scratch/words" ] || { echo "words.sh: no words in bold in the glossary of CONTRIBUTING.md"; exit 2; }
pattern=$(paste -sd '|' "$scratch/words")

# Of the sources only what stands between quotes: comments and names are the builders' own.
find src \( -name '*.c' -o -name '*.def' \) -exec awk '
    /^[ \t]*(#[ \t]*include|\/?\*)/ { next }
    { text = ""; while (match($0, /"([^"\\]|\\.)*"/)) {
          text = text " " substr($0, RSTART, RLENGTH); $0 = substr($0, RSTART + RLENGTH) }
      if (text != "") print FILENAME ":" FNR ":" text }' {} + >"$scratch/text"
find src -name '*.h' -exec grep -n '' /dev/null {} + >>"$scratch/text"
grep -n '' /dev/null README.md PROMISES.md CITATION.cff docs/*.md man/*.[15] validation/*.md workflow/*.md config/*.* \
    2>/dev/null | grep -v '^config/[^:]*\.fits' >>"$scratch/text"

# The campaigns' claims and committed summaries name a sample "told apart".
grep -aE "(^|[^A-Za-z_])($pattern)([^A-Za-z_]|$)" "$scratch/text" | grep -vE '^src/lab/.*told (apart|"$)' >"$scratch/found"
cat "$scratch/found"
echo "looked for $(wc -l <"$scratch/words") words in $(wc -l <"$scratch/text") lines: $(wc -l <"$scratch/found") found"
[ ! -s "$scratch/found" ]
