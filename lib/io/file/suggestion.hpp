#pragma once

#include <span>
#include <string>
#include <string_view>

namespace tunica {

/// The known word that was probably meant; empty where none is near.
std::string nearest(std::string_view word, std::span<const std::string_view> known);

/// What to say about a word that is not known: "did you mean 'x'?", or the list of what there is.
std::string suggestion(std::string_view word, std::span<const std::string_view> known);

}  // namespace tunica
