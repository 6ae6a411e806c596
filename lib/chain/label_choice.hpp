#pragma once

#include "tunica/chain/context.hpp"
#include "tunica/core/types.hpp"
#include "tunica/io/volume/label_names.hpp"
#include "tunica/io/volume/volume_file.hpp"
#include "tunica/volume/labels/mask.hpp"

#include <filesystem>
#include <optional>
#include <string>
#include <utility>
#include <vector>

/// Which labels of a volume are meant.
namespace tunica::chain {

/// The names of a volume's labels: those of a table that was named, else the volume's own, else those of a table beside
/// it.
class LabelTables {
public:
  /// Reads the table that was named, or the first beside the volume that is one; warns of what is none.
  void read(const std::filesystem::path& volume, const std::optional<std::filesystem::path>& named,
            const Context& context);

  [[nodiscard]] const LabelNames& of(const VolumeFile& file) const {
    return !given_.empty() ? given_ : !file.volume.label_names.empty() ? file.volume.label_names : beside_;
  }

  /// The labels behind a name of several, such as "1+2"; what is none as it is.
  [[nodiscard]] std::string unfolded(const std::string& text) const {
    const auto found = unions_.find(text);
    return found == unions_.end() ? text : found->second;
  }

private:
  LabelNames given_;
  LabelNames beside_;
  LabelUnions unions_;  ///< of the table that was named
};

/// Labels that are one organ.
struct LabelChoice {
  std::vector<double> values;      ///< each once
  std::vector<std::string> texts;  ///< as they were asked for
  std::string name;                ///< "label 3 (aorta)", "labels 1 (lumen) + 2 (thrombus)"
  std::string in_file_name;        ///< "3", "1+2"
};

/// The labels that a text asks for: a value or a name, or several with '+' between them. A name may hold a '+' itself:
/// what is a name as a whole is that, and parts are as long as they have to be.
/// @return the choice, or the first part that is no label's: a name that is not there, or the background
/// Errors: UsageError: a part is empty; InputError: several labels have that name.
std::pair<std::optional<LabelChoice>, std::string> choose_labels(const LabelNames& names, const std::string& text);

/// Selects the voxels of labels, slab by slab.
class LabelSelection {
public:
  LabelSelection(LabelChoice choice, const Volume& header);
  void add(const Volume& slab, std::size_t first_slice);

  [[nodiscard]] const LabelChoice& choice() const { return choice_; }
  /// What was asked for and has no voxel; empty where all have.
  [[nodiscard]] std::string absent() const;
  [[nodiscard]] Mask& mask() { return mask_; }

private:
  LabelChoice choice_;
  Mask mask_;
  std::vector<std::size_t> voxels_;  ///< of each value
};

}  // namespace tunica::chain
