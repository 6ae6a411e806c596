"""A map as SVG: a letter, a colour and the error in every cell, the theoretical border over them."""
import math
from html import escape

from atlas.judge import DOUBTFUL, REFUSED, RIGHT, WRONG

CELL = 74
LEFT, RIGHT_MARGIN, BELOW = 118, 24, 150
# Okabe and Ito's colours, mixed with white so that dark letters stand on them.
COLOURS = {RIGHT: "#8fd3bb", DOUBTFUL: "#f5d78a", REFUSED: "#a9cfee", WRONG: "#e58a4d"}
WORDS = {RIGHT: "right, within 10 %", DOUBTFUL: "announced as doubtful", REFUSED: "refused", WRONG: "WRONG"}


def error_text(error):
    """The error of a cell, short; none where nothing can be compared."""
    if math.isnan(error):
        return ""
    percent = abs(100 * error)
    if percent > 999:
        return "> 999 %"
    return f"{percent:.2g} %" if percent < 99.5 else f"{percent:.0f} %"


def wrapped(text, width):
    lines = [""]
    for word in text.split():
        if lines[-1] and len(lines[-1]) + len(word) + 1 > width:
            lines.append("")
        lines[-1] = f"{lines[-1]} {word}".strip()
    return lines


def text(x, y, size, words, anchor="middle", more=""):
    return (f"<text x=\"{x:.1f}\" y=\"{y:.1f}\" font-size=\"{size}\" text-anchor=\"{anchor}\" fill=\"#1a1a1a\"{more}>"
            f"{escape(words)}</text>")


def svg(chart, method, verdicts, name):
    """@param verdicts {(column, row): Verdict}; @param name of the map, as CELL takes it"""
    columns, rows = len(chart.x.values), len(chart.y.values)
    width = LEFT + columns * CELL + RIGHT_MARGIN
    title = wrapped(f"{chart.title}: {method.title}", int(width / 9.6))
    top = 26 + 22 * len(title)
    bottom = top + rows * CELL
    borders = [wrapped(border.label, int(width / 8.4)) for border in chart.borders]
    height = bottom + BELOW + 18 * sum(map(len, borders)) - (0 if borders else 20)
    out = [f"<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{width}\" height=\"{height}\" "
           f"viewBox=\"0 0 {width} {height}\" "
           "font-family=\"Helvetica, Arial, 'Liberation Sans', 'DejaVu Sans', sans-serif\">",
           f"<title>{escape(chart.title)}: {escape(method.title)}</title>",
           "<rect width=\"100%\" height=\"100%\" fill=\"#ffffff\"/>"]
    out += [text(16, 28 + 22 * k, 17, line, "start", " font-weight=\"bold\"") for k, line in enumerate(title)]
    letters = []  # over the borders
    for (i, j), verdict in sorted(verdicts.items()):
        x, y, colour = LEFT + i * CELL, top + (rows - 1 - j) * CELL, COLOURS[verdict.letter]
        tip = f"CELL={name}/{i}-{j}: {WORDS[verdict.letter]}; exit code {verdict.code}" + \
            (f"; {verdict.message}" if verdict.message else "")
        out.append(f"<g><title>{escape(tip)}</title><rect x=\"{x + 1}\" y=\"{y + 1}\" "
                   f"width=\"{CELL - 2}\" height=\"{CELL - 2}\" fill=\"{colour}\"/></g>")
        halo = f" stroke=\"{colour}\" stroke-width=\"5\" paint-order=\"stroke\" pointer-events=\"none\""
        letters += [text(x + CELL / 2, y + 34, 24, verdict.letter, more=halo + " font-weight=\"bold\""),
                    text(x + CELL / 2, y + 58, 14.5, error_text(verdict.error), more=halo)]
    out += [text(LEFT + (i + 0.5) * CELL, bottom + 20, 15, chart.x.name(i)) for i in range(columns)]
    out += [text(LEFT - 8, top + (rows - 0.5 - j) * CELL + 5, 15, chart.y.name(j), "end") for j in range(rows)]
    out.append(text(LEFT + columns * CELL / 2, bottom + 44, 15.5, chart.x.label))
    out.append(f"<g transform=\"translate(22 {top + rows * CELL / 2:.1f}) rotate(-90)\">" +
               text(0, 0, 15.5, chart.y.label) + "</g>")
    out.append(f"<clipPath id=\"plot\"><rect x=\"{LEFT}\" y=\"{top}\" width=\"{columns * CELL}\" "
               f"height=\"{rows * CELL}\"/></clipPath>")
    y = bottom + 122
    for number, border in enumerate(chart.borders):
        dash = ("", " stroke-dasharray=\"9 6\"")[number % 2]
        line = " ".join(f"{LEFT + (chart.x.place(px) + 0.5) * CELL:.1f},{bottom - (chart.y.place(py) + 0.5) * CELL:.1f}"
                        for px, py in border.points)
        stroke = f"fill=\"none\" stroke=\"#1a1a1a\" stroke-width=\"3\"{dash}"
        out.append(f"<polyline points=\"{line}\" {stroke} clip-path=\"url(#plot)\"/>")
        out.append(f"<polyline points=\"16,{y - 5} 52,{y - 5}\" {stroke}/>")
        for words in borders[number]:
            out.append(text(60, y, 14, words, "start"))
            y += 18
    out += letters
    for k, letter in enumerate((RIGHT, DOUBTFUL, REFUSED, WRONG)):
        x, y = 16 + k % 2 * width / 2, bottom + 62 + k // 2 * 24
        out.append(f"<rect x=\"{x:.1f}\" y=\"{y}\" width=\"20\" height=\"20\" fill=\"{COLOURS[letter]}\"/>" +
                   text(x + 10, y + 15.5, 15, letter, more=" font-weight=\"bold\"") +
                   text(x + 27, y + 15.5, 14, WORDS[letter], "start"))
    return "\n".join(out + ["</svg>", ""])
