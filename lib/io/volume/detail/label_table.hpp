#pragma once

#include "tunica/io/volume/label_names.hpp"

#include <optional>
#include <string>
#include <string_view>

/// What readers of label names share. Internal to lib/io.
namespace tunica::volume_format {

/// Why a name cannot follow these, or none: too many, too long, or not printable.
std::optional<std::string> label_error(const LabelNames& names, std::string_view name);

/// The names in the text of a NIfTI header extension, `<Label Key="1">aorta</Label>` in a `<LabelTable>`, as
/// TotalSegmentator and Connectome Workbench write it; none where the text is another one.
/// @param why  set where the text is such a table but damaged; the names before the damage are returned
/// Limits: entities of a document type are refused, so that none can be expanded.
LabelNames parse_label_table_xml(std::string_view text, std::optional<std::string>& why);

}  // namespace tunica::volume_format
