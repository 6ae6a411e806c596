#pragma once

#include <string>

/// Pictures and texts that say what made them, in the place that their format has for that.
namespace tunica {

/// The text with U+FFFD for the bytes that are no UTF-8: names of files may hold any.
std::string as_utf8(const std::string& text);

/// A PNG with `made_by` as its Comment (chunk iTXt, UTF-8) behind the header. Source: PNG specification, 11.3.4.5.
/// @param png  a whole PNG
std::string png_made_by(const std::string& png, const std::string& made_by);

/// The text with the signs of XML escaped, for elements and for attributes in double quotes.
std::string xml_escaped(const std::string& text);

/// As a comment of XML, such as SVG, VTK's and XDMF files have. Two hyphens, which must not stand in one, are parted.
std::string xml_made_by(const std::string& made_by);

}  // namespace tunica
