#!/bin/sh
# html.sh PAGE...: html/NAME.SECTION.html of each manual page, by mandoc, with links from page to page, and
# html/index.html. `make html` calls it in the build folder; top is the root of the sources.
set -eu
: "${top:?}"
{
    printf '<!DOCTYPE html>\n<html lang="en">\n<meta charset="utf-8">\n<title>Rextract</title>\n<h1>Rextract</h1>\n<dl>\n'
    for page in "$@"; do
        name=$(basename "$page")
        mandoc -T html -I os=Rextract "$top/$page" |
            sed 's,<b>\(rextract[a-z.-]*\)</b>(\([1-9]\)),<a href="\1.\2.html">&</a>,g' >"html/$name.html"
        about=$(sed -n '/^\.SH NAME/{n;s/.* \\- //p;q;}' "$top/$page") # of "name \- what it is"
        printf '<dt><a href="%s.html">%s(%s)</a><dd>%s\n' "$name" "${name%.*}" "${name##*.}" "$about"
    done
    printf '</dl>\n'
} >html/index.html
