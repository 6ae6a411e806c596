#pragma once

#include <string_view>

/// The files of web/ that every page carries, as cmake/Embed.cmake puts them into the program.
namespace tunica::report::embedded {

std::string_view report_js();
std::string_view report_css();
std::string_view report_html();
std::string_view LICENCES_txt();

}  // namespace tunica::report::embedded
