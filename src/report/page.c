/* HTML in the house style. */
#include "report/page.h"

#include <math.h>
#include <string.h>

#include "report/escape.h"

enum { LONG = 40 };

/* Light and dark by what the reader's system asks for; paper is always light. Text has a contrast of 4.5 at least on
 * its ground, lines of 3 (WCAG 2, AA; tests/pages.py measures it). Figures take --ink and --grid: report/figure.c. */
/* clang-format off */
static const char STYLE[] =
    ":root{color-scheme:light dark;--ink:#222;--soft:#595959;--ground:#fff;--head:#f4f4f4;--rule:#ddd;"
    "--grid:#e4e4e4;--link:#0b5394;--good:#1b7a2b;--bad:#b3261e;--open:#8a5a00}"
    "@media screen and (prefers-color-scheme:dark){:root{--ink:#e4e4e4;--soft:#adadad;--ground:#16181c;"
    "--head:#23262c;--rule:#3a3e46;--grid:#31353c;--link:#8ab4f8;--good:#6fcf7f;--bad:#ff8a80;--open:#e8b54a}"
    "}"
    "body{font:15px/1.5 system-ui,sans-serif;color:var(--ink);background:var(--ground);max-width:1100px;"
    "margin:0 auto;padding:1em 1.5em;overflow-wrap:anywhere}"
    "h1{font-size:1.6em;margin:.3em 0;line-height:1.25}"
    "h2{font-size:1.25em;margin:2em 0 .5em;border-bottom:1px solid var(--rule)}h3{font-size:1em}"
    "nav a{margin-right:1em;display:inline-block}a{color:var(--link)}.skip{position:absolute;left:-99em}"
    ".skip:focus{position:static}:focus-visible{outline:2px solid var(--link);outline-offset:2px}"
    "summary{cursor:pointer}pre{white-space:pre-wrap}"
    "table{border-collapse:collapse;margin:.7em 0;font-size:.92em;overflow-wrap:normal}"
    "th,td{padding:.25em .7em;text-align:right;border-bottom:1px solid var(--rule);white-space:nowrap}"
    "th[scope=col]{background:var(--head)}tr:hover>*{background:var(--head)}"
    "tr.u td:nth-child(n+3){text-align:right}td.t,th.t{text-align:left;white-space:normal}"
    "td.l{min-width:15em}table th.t{font-weight:600}td small,.pale{color:var(--soft)}"
    "p.r{color:var(--soft);font-size:.92em;margin:.2em 0 1em;max-width:64em}"
    ".f{display:flex;flex-wrap:wrap;gap:1em}figure{margin:0;flex:1 1 440px;max-width:520px;min-width:0}"
    "figure.p{flex:0 1 300px}figure.l{flex:0 1 1060px;max-width:none}"
    "figure svg{display:block;width:100%;height:auto;fill:none;stroke:currentColor;"
    "font:13px Helvetica,Arial,sans-serif}figure text{fill:currentColor;stroke:none}"
    "figure image{image-rendering:pixelated}svg .gridline{stroke:var(--grid)}"
    "svg .h{opacity:0;pointer-events:all}svg .h:hover{opacity:1}figcaption b{display:block;color:var(--ink)}"
    "figcaption{color:var(--soft);font-size:.9em}.PASS{color:var(--good)}.FAIL{color:var(--bad)}"
    ".INSUFFICIENT{color:var(--open)}b.v{font-size:1.2em}.w{overflow-x:auto}"
    "@media print{body{max-width:none;padding:0;font-size:10pt}nav,.skip{display:none}.w{overflow:visible}"
    "th,td{white-space:normal;padding:.15em .4em}figure,tr{break-inside:avoid}h2,h3,tr:has(th[scope=col]){"
    "break-after:avoid}figure{flex-basis:48%}figure.p{flex-basis:31%}figure.l{flex-basis:100%}a{"
    "color:inherit}}";
/* clang-format on */

void rx_page_begin(rx_text *dst, const char *kind, const char *title)
{
    rx_text_add(dst, "<!DOCTYPE html>\n<html lang=\"en\"><head><meta charset=\"utf-8\">\n<meta "
                     "name=\"viewport\" content=\"width=device-width\">\n<title>");
    rx_escape_html(dst, kind);
    rx_escape_html(dst, title);
    rx_text_printf(dst,
                   "</title>\n<style>%s</style></head>\n<body>\n<a class=\"skip\" "
                   "href=\"#main\">Skip to the content</a>\n<header>\n<h1>",
                   STYLE);
    rx_escape_html(dst, kind);
    rx_escape_html(dst, title);
    rx_text_add(dst, "</h1>\n");
}

void rx_page_end(rx_text *dst)
{
    rx_text_add(dst, "</main>\n</body></html>\n");
}

void rx_page_links_begin(rx_text *dst)
{
    rx_text_add(dst, "<nav aria-label=\"Sections\">");
}

void rx_page_link(rx_text *dst, bool there, const char *id, const char *text)
{
    if (!there)
        return;
    rx_text_printf(dst, "<a href=\"#%s\">", id);
    rx_escape_html(dst, text);
    rx_text_add(dst, "</a>");
}

void rx_page_links_end(rx_text *dst)
{
    rx_text_add(dst, "</nav>\n</header>\n<main id=\"main\">\n");
}

void rx_page_section(rx_text *dst, const char *id, const char *text)
{
    rx_text_printf(dst, "<h2 id=\"%s\">", id);
    rx_escape_html(dst, text);
    rx_text_add(dst, "</h2>\n");
}

void rx_page_heading(rx_text *dst, const char *text, const char *unit)
{
    rx_text_add(dst, "<h3>");
    rx_escape_html(dst, text);
    rx_page_unit(dst, unit);
    rx_text_add(dst, "</h3>\n");
}

void rx_page_unit(rx_text *dst, const char *unit)
{
    if (unit == NULL || unit[0] == '\0')
        return;
    rx_text_add(dst, " [");
    rx_escape_html(dst, unit);
    rx_text_add(dst, "]");
}

void rx_page_paragraph(rx_text *dst, const char *html)
{
    rx_text_printf(dst, "<p>%s</p>\n", html);
}

void rx_page_note(rx_text *dst, const char *html)
{
    rx_text_printf(dst, "<p class=\"r\">%s</p>\n", html);
}

void rx_page_table_begin(rx_text *dst)
{
    rx_text_add(dst, "<div class=\"w\" tabindex=\"0\"><table>\n");
}

void rx_page_table_end(rx_text *dst)
{
    rx_text_add(dst, "</table></div>\n");
}

void rx_page_row(rx_text *dst, const char *mark)
{
    if (mark != NULL && mark[0] != '\0')
        rx_text_printf(dst, "<tr class=\"%s\">", mark);
    else
        rx_text_add(dst, "<tr>");
}

void rx_page_row_end(rx_text *dst)
{
    rx_text_add(dst, "</tr>\n");
}

void rx_page_head(rx_text *dst, rx_align align, const char *text, const char *unit)
{
    rx_text_add(dst, align == RX_LEFT ? "<th scope=\"col\" class=\"t\">" : "<th scope=\"col\">");
    rx_escape_html(dst, text);
    rx_page_unit(dst, unit);
    rx_text_add(dst, "</th>");
}

void rx_page_cell_file(rx_text *dst, const char *name)
{
    const char *shown = name != NULL ? name : "";
    if (shown[0] == '\0') {
        rx_page_cell_text(dst, NULL);
        return;
    }
    rx_text_add(dst, "<td class=\"t\"><a href=\"");
    for (const char *c = name; *c != '\0'; c++) /* what means something in an address */
        if ((unsigned char)*c < 0x20 || (unsigned char)*c > 0x7e || strchr("%#? ", *c) != NULL)
            rx_text_printf(dst, "%%%02X", (unsigned char)*c);
        else if (strchr("&<>\"'", *c) != NULL)
            rx_text_printf(dst, "&#%d;", *c);
        else
            rx_text_add_bytes(dst, c, 1);
    rx_text_add(dst, "\">");
    while (strncmp(shown, "../", 3) == 0)
        shown += 3;
    rx_escape_html(dst, shown);
    rx_text_add(dst, "</a></td>");
}

void rx_page_cell_title(rx_text *dst, const char *text, const char *unit)
{
    rx_text_add(dst, "<th scope=\"row\" class=\"t\">");
    rx_escape_html(dst, text);
    rx_page_unit(dst, unit);
    rx_text_add(dst, "</th>");
}

void rx_page_cell_text(rx_text *dst, const char *text)
{
    /* long words keep some width beside numbers, which do not wrap */
    rx_text_add(dst, text != NULL && strlen(text) > LONG ? "<td class=\"t l\">" : "<td class=\"t\">");
    if (text != NULL && text[0] != '\0')
        rx_escape_html(dst, text);
    else
        rx_text_add(dst, "&ndash;");
    rx_text_add(dst, "</td>");
}

void rx_page_number(rx_text *dst, double value, int digits)
{
    if (isnan(value))
        rx_text_add(dst, "&ndash;");
    else if (isinf(value))
        rx_text_add(dst, value > 0 ? "&infin;" : "&minus;&infin;");
    else if (digits < 0)
        rx_text_printf(dst, "%.*g", -digits, value);
    else if (fabs(value) >= (digits > 0 ? 1e6 : 1e15)) /* whole numbers keep their digits */
        rx_text_printf(dst, "%.3g", value);
    else if (fabs(value) < 0.5 * pow(10, -digits))
        rx_text_printf(dst, "%.*f", digits, 0.0); /* never -0.00 */
    else
        rx_text_printf(dst, "%.*f", digits, value);
}

void rx_page_estimate(rx_text *dst, const rx_estimate *e, int digits)
{
    if (e->n == 0 && isnan(e->value)) {
        rx_text_add(dst, "&ndash;");
        return;
    }
    rx_page_number(dst, e->value, digits);
    rx_text_add(dst, " <small>[");
    rx_page_number(dst, e->low, digits);
    rx_text_add(dst, ", ");
    rx_page_number(dst, e->high, digits);
    rx_text_printf(dst, "] n=%ld</small>", e->n);
}

/* Mantissa and exponent from the logarithm where the number itself is too small for a double. */
void rx_page_p(rx_text *dst, double p, double ln_p)
{
    if (isnan(p) || isnan(ln_p)) {
        rx_text_add(dst, "&ndash;");
    } else if (p >= 0.001) {
        rx_text_printf(dst, "%.2g", p);
    } else if (isinf(ln_p)) { /* where no more is known than that p vanished */
        rx_text_add(dst, "&lt;10<sup>&minus;307</sup>");
    } else {
        double decades = ln_p / M_LN10, exponent = floor(decades);
        double mantissa = round(pow(10, decades - exponent) * 10) / 10;
        if (mantissa >= 10) {
            mantissa /= 10;
            exponent += 1;
        }
        rx_text_printf(dst, "%.1f&middot;10<sup>&minus;%.0f</sup>", mantissa, -exponent);
    }
}

void rx_page_cell_number(rx_text *dst, double value, int digits)
{
    rx_text_add(dst, "<td>");
    rx_page_number(dst, value, digits);
    rx_text_add(dst, "</td>");
}

void rx_page_cell_measured(rx_text *dst, double value, double error, int digits)
{
    rx_text_add(dst, "<td>");
    rx_page_number(dst, value, digits);
    if (isfinite(value) && isfinite(error)) {
        rx_text_add(dst, " &plusmn; ");
        rx_page_number(dst, error, digits);
    }
    rx_text_add(dst, "</td>");
}

void rx_page_cell_count(rx_text *dst, long n)
{
    rx_text_printf(dst, "<td>%ld</td>", n);
}

void rx_page_cell_estimate(rx_text *dst, const rx_estimate *e, int digits)
{
    rx_text_add(dst, "<td>");
    rx_page_estimate(dst, e, digits);
    rx_text_add(dst, "</td>");
}

void rx_page_cell_p(rx_text *dst, double p, double ln_p)
{
    rx_text_add(dst, "<td>");
    rx_page_p(dst, p, ln_p);
    rx_text_add(dst, "</td>");
}

void rx_page_cell_verdict(rx_text *dst, const char *mark, const char *text)
{
    rx_text_printf(dst, "<td class=\"t %s\"><b>", mark);
    rx_escape_html(dst, text);
    rx_text_add(dst, "</b></td>");
}

/* Its SVG (or "not drawn"), title and reading. */
static void put_figure(rx_text *dst, const rx_figure *figure)
{
    static const char *const frame[] = {"<figure>", "<figure class=\"p\">", "<figure class=\"l\">"};
    bool picture = figure->kind == RX_FIGURE_PICTURE;
    rx_text_add(dst, frame[figure->kind]);
    rx_text_add(dst, figure->svg != NULL ? figure->svg : "<p>not drawn</p>");
    rx_text_add(dst, picture ? "<figcaption>" : "<figcaption><b>");
    rx_escape_html(dst, figure->title);
    rx_text_add(dst, !picture ? "</b>" : figure->reading[0] != '\0' ? ": " : "");
    rx_escape_html(dst, figure->reading);
    rx_text_add(dst, "</figcaption></figure>\n");
}

void rx_page_figures(rx_text *dst, const rx_figures *figures, const char *prefix)
{
    if (figures->note[0] != '\0') {
        rx_text_add(dst, "<p><b>No figures:</b> ");
        rx_escape_html(dst, figures->note);
        rx_text_add(dst, ". The tables are complete.</p>\n");
        return;
    }
    rx_text_add(dst, "<div class=\"f\">\n");
    for (int i = 0; i < figures->n; i++)
        if (strncmp(figures->figure[i].id, prefix, strlen(prefix)) == 0)
            put_figure(dst, &figures->figure[i]);
    rx_text_add(dst, "</div>\n");
}

void rx_page_record(rx_text *dst, int n, const char *const (*pairs)[2])
{
    rx_text_add(dst, "<details><summary>configuration and inputs</summary>\n");
    rx_page_table_begin(dst);
    for (int i = 0; i < n; i++) {
        rx_page_row(dst, NULL);
        rx_page_cell_title(dst, pairs[i][0], NULL);
        rx_page_cell_text(dst, pairs[i][1]);
        rx_page_row_end(dst);
    }
    rx_page_table_end(dst);
    rx_text_add(dst, "</details>\n");
}
