#pragma once

#include "tunica/io/volume/label_names.hpp"

#include <filesystem>
#include <optional>
#include <string>
#include <string_view>

/// What readers of label names share. Internal to lib/io.
namespace tunica::volume_format {

/// Why a name cannot follow these, or none: too many, too long, or not printable.
std::optional<std::string> label_error(const LabelNames& names, std::string_view name);

/// Text in UTF-8 without a byte order mark: from UTF-16, which has one, else from Windows-1252 (Latin-1 is a part of
/// it) where it is no UTF-8. Errors: InputError naming the file: damaged UTF-16, text that holds zeros.
std::string to_utf8(const std::filesystem::path& path, std::string bytes);

/// The names in a JSON text: {"1": "aorta"}, {"aorta": 1}, [{"value": 1, "name": "aorta"}], by themselves or under
/// "labels" (nnU-Net's dataset.json) or "segmentAttributes" (dcmqi). Names of several labels are left out.
/// Errors: InputError naming the file: no JSON, another shape, a key twice, nested deeper than 16.
LabelNames parse_label_json(const std::filesystem::path& path, std::string_view text, LabelUnions* unions);

/// The names in the text of a NIfTI header extension, `<Label Key="1">aorta</Label>` in a `<LabelTable>`, as
/// TotalSegmentator and Connectome Workbench write it; none where the text is another one.
/// @param why  set where the text is such a table but damaged; the names before the damage are returned
/// Limits: entities of a document type are refused, so that none can be expanded.
LabelNames parse_label_table_xml(std::string_view text, std::optional<std::string>& why);

}  // namespace tunica::volume_format
