#include "tunica/core/narrow.hpp"
#include "tunica/core/quantity.hpp"
#include "tunica/io/volume/detail/label_table.hpp"
#include "tunica/io/volume/detail/volume_format.hpp"

#include <expat.h>

#include <fmt/format.h>

#include <memory>
#include <type_traits>

namespace tunica::volume_format {
namespace {

struct Reading {
  XML_Parser parser = nullptr;
  LabelNames names;
  std::size_t tables = 0;  // open <LabelTable>
  std::optional<double> key;
  std::string name;
  std::optional<std::string> why;

  void stop(std::string reason) {
    why = std::move(reason);
    XML_StopParser(parser, XML_FALSE);
  }
};

void begin(void* data, const XML_Char* element, const XML_Char** attributes) {
  Reading& reading = *static_cast<Reading*>(data);
  const std::string_view name = element;
  reading.tables += name == "LabelTable" ? 1 : 0;
  if (name != "Label" || reading.tables == 0) {
    return;
  }
  reading.key.reset();
  reading.name.clear();
  for (; *attributes != nullptr; attributes += 2) {
    if (std::string_view(attributes[0]) == "Key") {
      reading.key = parse_number(attributes[1]);
    }
  }
  if (!reading.key) {
    reading.stop("a label has no number for its Key");
  }
}

void text_of(void* data, const XML_Char* text, int size) {
  Reading& reading = *static_cast<Reading*>(data);
  constexpr std::size_t longest_text = 4096;  // longer than any name that is taken
  if (reading.key && reading.name.size() < longest_text) {
    reading.name.append(text, narrow<std::size_t>(size));
  }
}

void end(void* data, const XML_Char* element) {
  Reading& reading = *static_cast<Reading*>(data);
  const std::string_view name = element;
  reading.tables -= name == "LabelTable" && reading.tables > 0 ? 1 : 0;
  if (name != "Label" || !reading.key) {
    return;
  }
  const std::string_view label = trimmed(reading.name);
  if (auto why = label_error(reading.names, label)) {
    reading.stop(std::move(*why));
  } else if (!label.empty()) {
    reading.names.emplace_back(*reading.key, label);
  }
  reading.key.reset();
}

void refuse_doctype(void* data, const XML_Char*, const XML_Char*, const XML_Char*, int) {
  static_cast<Reading*>(data)->stop("it declares a document type");
}

}  // namespace

LabelNames parse_label_table_xml(std::string_view text, std::optional<std::string>& why) {
  text = text.substr(0, text.find('\0'));  // extensions are filled up with zeros
  if (text.find("<LabelTable") == std::string_view::npos) {
    return {};
  }
  const std::unique_ptr<std::remove_pointer_t<XML_Parser>, decltype(&XML_ParserFree)> parser(XML_ParserCreate(nullptr),
                                                                                             XML_ParserFree);
  Reading reading;
  reading.parser = parser.get();
  if (!parser) {
    throw std::bad_alloc();
  }
  XML_SetUserData(parser.get(), &reading);
  XML_SetElementHandler(parser.get(), begin, end);
  XML_SetCharacterDataHandler(parser.get(), text_of);
  XML_SetStartDoctypeDeclHandler(parser.get(), refuse_doctype);
  if (XML_Parse(parser.get(), text.data(), narrow<int>(text.size()), 1) != XML_STATUS_OK) {
    why = reading.why ? *reading.why
                      : fmt::format("{} at byte {}", XML_ErrorString(XML_GetErrorCode(parser.get())),
                                    XML_GetCurrentByteIndex(parser.get()));
  }
  return std::move(reading.names);
}

}  // namespace tunica::volume_format
