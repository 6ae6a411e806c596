#include "tunica/draw/detail/svg_text.hpp"

#include "tunica/core/narrow.hpp"

#include <algorithm>
#include <array>

namespace tunica {
namespace {

// Replaces what is not UTF-8 (file names are any bytes), and U+FFFE, U+FFFF, which XML forbids.
std::string valid_utf8(const std::string& text) {
  std::string out;
  for (std::size_t i = 0; i < text.size();) {
    const auto first = static_cast<unsigned char>(text[i]);
    const std::size_t length = first < 0x80 ? 1 : first >= 0xf0 ? 4 : first >= 0xe0 ? 3 : first >= 0xc2 ? 2 : 0;
    bool good = length > 0 && first < 0xf5 && i + length <= text.size();
    unsigned code = length > 1 ? first & (0x7fu >> length) : first;
    for (std::size_t k = 1; good && k < length; ++k) {
      const auto next = static_cast<unsigned char>(text[i + k]);
      good = (next & 0xc0) == 0x80;
      code = code << 6 | (next & 0x3fu);
    }
    constexpr std::array<unsigned, 5> least{0, 0, 0x80, 0x800, 0x10000};
    good = good && code >= least[length] && (code < 0xd800 || code > 0xdfff) && code != 0xfffe && code != 0xffff &&
           code <= 0x10ffff;
    out += good ? text.substr(i, length) : "?";
    i += good ? length : 1;
  }
  return out;
}

}  // namespace

std::string printable(const std::string& text) {
  std::string out = valid_utf8(text);
  for (char& c : out) {
    const auto byte = static_cast<unsigned char>(c);
    c = byte < 0x20 || byte == 0x7f ? ' ' : c;
  }
  return out;
}

std::string safe(const std::string& text) {
  std::string out;
  for (const char c : printable(text)) {
    switch (c) {
      case '&':
        out += "&amp;";
        break;
      case '<':
        out += "&lt;";
        break;
      case '>':
        out += "&gt;";
        break;
      case '"':
        out += "&quot;";
        break;
      default:
        out += c;
    }
  }
  return out;
}

std::string shortened(const std::string& text, std::size_t most) {
  const std::string clean = valid_utf8(text);
  std::vector<std::string> characters;
  for (const char c : clean) {
    if ((static_cast<unsigned char>(c) & 0xc0) != 0x80) {
      characters.emplace_back();
    }
    characters.back() += c;
  }
  if (characters.size() <= most) {
    return clean;
  }
  std::string out;
  const std::size_t head = (most - 1) / 2;
  const std::size_t tail = most - 1 - head;
  for (std::size_t i = 0; i < head; ++i) {
    out += characters[i];
  }
  out += "…";
  for (std::size_t i = characters.size() - tail; i < characters.size(); ++i) {
    out += characters[i];
  }
  return out;
}

std::string fitted(const std::string& text, double width, double size) {
  std::string out = shortened(text, 200);
  for (std::size_t most = 200; most > 3 && text_width(out, size) > width; --most) {
    out = shortened(text, most);
  }
  return out;
}

std::vector<std::string> wrapped(const std::string& text, double width, double size) {
  std::vector<std::string> lines;
  for (std::size_t start = 0; start < text.size();) {
    const std::size_t end = std::min(text.find(' ', start), text.size());
    const std::string word = text.substr(start, end - start);
    const bool full = lines.empty() || text_width(lines.back() + " " + word, size) > width;
    if (full && lines.size() < 3) {
      lines.push_back(word);
    } else {
      lines.back() += " " + word;
    }
    start = end + 1;
  }
  for (std::string& line : lines) {
    line = fitted(line, width, size);
  }
  return lines;
}

}  // namespace tunica
