#pragma once

#include <string>
#include <vector>

/// Texts in SVG files: what XML allows, and how much room they take. Texts may hold any bytes.
namespace tunica {

/// Valid UTF-8 in one line: a question mark for what is none, a blank for a control character.
std::string printable(const std::string& text);

/// The same with the signs of XML escaped.
std::string safe(const std::string& text);

/// From the beginning of the text to where the next one would begin, in the font of pictures. Pixels.
double text_width(const std::string& text, double size);

/// Cuts the middle out of a text that is longer than `most` characters.
std::string shortened(const std::string& text, std::size_t most);

/// Shortens a text until it is no wider than this, in pixels.
std::string fitted(const std::string& text, double width, double size);

/// Breaks a text between words into lines of this width, at most three.
std::vector<std::string> wrapped(const std::string& text, double width, double size);

}  // namespace tunica
