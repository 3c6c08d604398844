# Functions and tables that headers declare, a name a line: what librextract exports (Makefile.am). Headers are
# as clang-format leaves them: a function's name stands outside of all brackets, before "(".
{
    line = $0
    while (line != "") {
        if (inside) {
            end = index(line, "*/")
            if (!end) break
            line = substr(line, end + 2)
            inside = 0
        } else if (match(line, /\/\*|\/\//)) {
            comment = substr(line, RSTART, 2)
            text = text " " substr(line, 1, RSTART - 1)
            line = substr(line, RSTART + 2)
            if (comment == "//") break
            inside = 1
        } else {
            text = text " " line
            break
        }
    }
    # A directive is no declaration; one that goes on in the next line takes that with it.
    if (text ~ /^ *#/) {
        if (text ~ /\\ *$/) sub(/\\ *$/, "", text)
        else text = ""
        next
    }
    if (text ~ /^ *(RX_BEGIN_DECLS|RX_END_DECLS) *$/) text = ""
    while (match(text, /[{};]/)) {
        mark = substr(text, RSTART, 1)
        if (depth == 0) declaration = declaration substr(text, 1, RSTART - 1)
        text = substr(text, RSTART + 1)
        if (mark == "{") depth++
        if (mark == "}") depth--
        if (depth == 0 && mark == "}" && declaration ~ /^ *static inline/) declaration = ""
        if (depth == 0 && mark == ";") {
            take(declaration)
            declaration = ""
        }
    }
    if (depth == 0) declaration = declaration text
    text = ""
}
function take(what) {
    if (what ~ /^ *(typedef|static|struct|enum|union) / && what !~ /\(/) return
    if (what ~ /^ *(typedef|static) /) return
    if (what ~ /^ *extern / && what !~ /\(/) sub(/(\[.*)?$/, "(", what)
    if (match(what, /[A-Za-z_][A-Za-z0-9_]* *\(/)) {
        name = substr(what, RSTART, RLENGTH - 1)
        sub(/ *$/, "", name)
        print name
    }
}
