// io/volume: formats of segmented volumes, a file each, and names of their labels.
#pragma once

#include "tunica/core/warning.hpp"

#include <filesystem>
#include <map>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

namespace tunica {

/// Names of labels, by label value; as Volume::label_names.
using LabelNames = std::vector<std::pair<double, std::string>>;

/// Names of several labels together, and these as a text: {"whole tumour", "1+2+3"}.
using LabelUnions = std::map<std::string, std::string>;

/// Reads a table of labels; what it is its content says, not its name:
///   BIDS `_dseg.tsv`       columns `index` and `name` (brainlife's `label` and Slicer's .csv too) between tabs, `;` or
///   `,` lists without heading  lines `index;name` or `index,name` JSON                   {"1": "aorta"}, {"aorta": 1},
///   [{"value": 1, "name": "aorta"}], also under "labels" (nnU-Net) ITK-SNAP               lines `index R G B A visible
///   mesh "name"` Slicer .ctbl, FreeSurfer's look-up table   lines `index name R G B A`; a name may have blanks, `#` is
///   a comment
/// @param unions  gets the names of several labels: nnU-Net's regions, {"whole tumour": [1, 2, 3]} in JSON
/// The text is UTF-8, UTF-16 with a byte order mark, or, where it is no UTF-8, Windows-1252 (Latin-1).
/// @return the names in the file's order, at least one, in UTF-8
/// Errors: InputError naming file and line: missing, no such table, larger than 16 MiB, more than 65536 labels, a name
/// of more than 200 bytes or with control characters.
/// Sources: BIDS 1.8 "Segmentations"; ITK-SNAP's "Save Label Descriptions"; FreeSurfer "ColorLUT".
LabelNames read_label_names(const std::filesystem::path& path, LabelUnions* unions = nullptr);

/// The tables of labels beside a volume: files of its stem that end in .tsv, .ctbl, .label, .lut, .txt or .csv.
std::vector<std::filesystem::path> label_tables_beside(const std::filesystem::path& volume);

/// The label a text means: its value, or its name. @return none where there is no such name
/// Errors: InputError: several labels have that name; a whole number above 2^53 that no double is equal to.
std::optional<double> find_label(const LabelNames& names, const std::string& text);

/// The warning that a label has several names, of which one is wrong; none where each has one.
/// @param path  of the file that gives them
std::optional<Warning> several_names(const std::filesystem::path& path, const LabelNames& names);

/// The name that was probably meant by one that is not there; empty where none is near. Cost: the names of about its
/// length.
std::string nearest_label(const LabelNames& names, std::string_view text);

}  // namespace tunica
