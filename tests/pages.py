"""pages.py PAGE...: what every page that is written must have; names what a page lacks and ends with 1.

A language, a title, one h1, a header and a main part with a link to it, headings without a gap, a text for every figure, a scope and
words for every head of a table, links that lead somewhere, nothing from elsewhere and no script, colours that can be read on light
and dark ground (WCAG 2, AA: 4.5 for text, 3 for lines), less than 1 MB.

pages.py -PROBE PAGE COPY: a copy with a script that writes into its title what is wider than the window.
"""

import re
import sys
from html.parser import HTMLParser

VOID = {"meta", "br", "img", "hr", "link", "input", "path", "rect", "circle", "use", "polygon", "image", "line", "polyline"}
PROBE = """<script>
const wide = [...document.body.querySelectorAll("*")].filter(e => e.getBoundingClientRect().right > innerWidth + 1 && !e.closest(".w"));
document.title = "PROBE " + innerWidth + " " + document.documentElement.scrollWidth + " " + wide.slice(0, 5).map(e => e.tagName + " " + e.className).join(", ");
</script></body>"""


class Page(HTMLParser):
    def __init__(self):
        super().__init__()
        self.trouble, self.open, self.count, self.ids, self.targets, self.text = [], [], {}, [], [], {}
        self.level, self.lines, self.style = 0, set(), ""

    def lacks(self, what):
        if what not in self.trouble:
            self.trouble.append(what)

    def handle_starttag(self, tag, pairs):
        at = dict(pairs)
        self.count[tag] = self.count.get(tag, 0) + 1
        if "id" in at:
            self.ids.append(at["id"])
        for name, value in pairs:
            value = value or ""
            if name.startswith("on"):
                self.lacks(f"no script: {tag} has {name}")
            if name in ("href", "xlink:href", "src", "action"):
                if value.startswith("#"):
                    self.targets.append(value[1:])
                elif re.match(r"[a-z]+:|//", value) and not value.startswith("data:"):
                    self.lacks(f"nothing from elsewhere: {tag} {value[:60]}")
        if tag in ("script", "link", "iframe", "object", "embed"):
            self.lacks(f"nothing from elsewhere, no script: {tag}")
        if tag == "html" and not at.get("lang"):
            self.lacks("a language")
        if tag == "img" and not at.get("alt"):
            self.lacks("alt of img")
        if tag == "th" and at.get("scope") not in ("col", "row"):
            self.lacks("scope of th")
        if tag == "svg" and at.get("role") != "img":
            self.lacks("role of svg")
        if re.fullmatch("h[1-6]", tag):
            if int(tag[1]) > self.level + 1:
                self.lacks(f"a heading between h{self.level} and {tag}")
            self.level = int(tag[1])
        if tag == "path" and "svg" in self.open and "opacity" not in at and re.fullmatch("#[0-9A-Fa-f]{6}", at.get("stroke") or ""):
            self.lines.add(at["stroke"])
        if tag not in VOID:
            self.open.append(tag)
            self.text.setdefault(tag, []).append("")

    def handle_startendtag(self, tag, pairs):
        self.handle_starttag(tag, pairs)
        if tag not in VOID:
            self.handle_endtag(tag)

    def handle_endtag(self, tag):
        if tag in VOID:
            return
        if not self.open or self.open.pop() != tag:
            self.lacks(f"tags that match: {tag}")
        if tag in ("title", "th", "summary", "figcaption", "h1", "h2", "h3") and not self.text[tag][-1].strip():
            self.lacks(f"words in {tag}")

    def handle_data(self, data):
        for tag in self.open:
            self.text[tag][-1] += data
        if self.open and self.open[-1] == "style":
            self.style += data


def luminance(colour):
    colour = colour.lstrip("#")
    parts = [int(c * 2 if len(colour) == 3 else c, 16) / 255 for c in (colour if len(colour) == 3 else re.findall("..", colour))]
    return sum(w * (p / 12.92 if p <= 0.04045 else ((p + 0.055) / 1.055) ** 2.4) for w, p in zip((0.2126, 0.7152, 0.0722), parts))


def contrast(one, other):
    a, b = sorted((luminance(one), luminance(other)))
    return (b + 0.05) / (a + 0.05)


def check(name):
    content = open(name, "rb").read()
    text = content.decode("utf-8")
    page = Page()
    page.feed(text)
    for tag, n in (("html", 1), ("h1", 1), ("header", 1), ("main", 1), ("nav", 1)):
        if page.count.get(tag, 0) != n:
            page.lacks(f"one {tag}: {page.count.get(tag, 0)}")
    if not re.search(r"<head>.*<title>[^<]+</title>.*</head>", text, re.S):
        page.lacks("a title")
    if not re.search(r'<body>\s*<a class="skip" href="#main">.*<main id="main">', text, re.S):
        page.lacks("a link to the main part")
    for svg in re.findall(r"<svg.*?</svg>", text, re.S):
        if not re.match(r"<svg[^>]*>\s*<title>[^<]+</title>", svg):
            page.lacks("a title of svg")
    if page.count.get("figure", 0) != page.count.get("figcaption", 0):
        page.lacks("a text for each figure")
    if page.count.get("details", 0) != page.count.get("summary", 0):
        page.lacks("a summary of details")
    for twice in sorted({i for i in page.ids if page.ids.count(i) > 1}):
        page.lacks(f"an id only once: {twice}")
    for target in sorted(set(page.targets) - set(page.ids)):
        page.lacks(f"what a link leads to: #{target}")
    if re.search(r"url\((?!#)|@import", page.style):
        page.lacks("nothing from elsewhere: style")
    schemes = [dict(re.findall(r"--(\w+):(#\w+)", root)) for root in re.findall(r":root\{([^}]*)\}", page.style)]
    if len(schemes) != 2 or "prefers-color-scheme:dark" not in page.style or "@media print" not in page.style:
        page.lacks("styles for light, dark and paper")
    for s in schemes:
        for words in ("ink", "soft", "link", "good", "bad", "open"):
            for ground in ("ground", "head"):
                if contrast(s[words], s[ground]) < 4.5:
                    page.lacks(f"contrast of {words} on {ground}: {contrast(s[words], s[ground]):.2f}")
        for line in page.lines:
            if contrast(line, s["ground"]) < 3:
                page.lacks(f"contrast of a line {line} on {s['ground']}: {contrast(line, s['ground']):.2f}")
    if len(content) >= 1000000:
        page.lacks(f"less than 1 MB: {len(content)} bytes")
    for trouble in page.trouble:
        print(f"{name}: lacks {trouble}")
    return not page.trouble


if sys.argv[1] == "-PROBE":
    with open(sys.argv[3], "w", encoding="utf-8") as file:
        file.write(open(sys.argv[2], encoding="utf-8").read().replace("</body>", PROBE))
else:
    sys.exit(0 if all([check(name) for name in sys.argv[1:]]) else 1)
