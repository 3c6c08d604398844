#!/bin/sh
# html.sh PAGE...: html/NAME.SECTION.html of each manual page, by mandoc, with links from page to page, and
# html/index.html. `make html` calls it in the build folder; top is the root of the sources.
set -eu
: "${top:?}"
cat >html/man.css <<'CSS'
:root { color-scheme: light dark }
body { max-width: 60rem; margin: 1rem auto; padding: 0 1rem; font: 1rem/1.5 sans-serif }
h1 { font-size: 1.3rem; margin: 1.5rem 0 .5rem } h2 { font-size: 1.1rem; margin: 1rem 0 .5rem }
.permalink { color: inherit; text-decoration: none } .permalink:hover { text-decoration: underline }
.head, .foot { width: 100% } .head-vol, .foot-date { text-align: center } .head-rtitle, .foot-os { text-align: right }
pre { overflow-x: auto; line-height: 1.3 } dd { margin-left: 2rem }
CSS
{
    printf '<!DOCTYPE html>\n<html lang="en">\n<meta charset="utf-8">\n<meta name="viewport" content="width=device-width">\n<link rel="stylesheet" href="man.css">\n<title>Rextract</title>\n<h1>Rextract</h1>\n<dl>\n'
    for page in "$@"; do
        name=$(basename "$page")
        mandoc -T html -O style=man.css -I os=Rextract "$top/$page" |
            sed -e 's/<html>/<html lang="en">/' -e 's,<b>\(rextract[a-z.-]*\)</b>(\([1-9]\)),<a href="\1.\2.html">&</a>,g' >"html/$name.html"
        about=$(sed -n '/^\.SH NAME/{n;s/.* \\- //p;q;}' "$top/$page") # of "name \- what it is"
        printf '<dt><a href="%s.html">%s(%s)</a><dd>%s\n' "$name" "${name%.*}" "${name##*.}" "$about"
    done
    printf '</dl>\n'
} >html/index.html
