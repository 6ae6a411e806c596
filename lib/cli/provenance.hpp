#pragma once

#include <filesystem>
#include <string>
#include <utility>
#include <vector>

namespace tunica::cli {

/// What a run says of itself in what it writes: its command, and the names of its files, or, with --no-paths, words in
/// their place (input1.nii.gz, OUT.ply), so that no folder and no file's name, which may be a patient's, is written.
class Provenance {
public:
  /// @param words  of the command line, the first already the tool's name
  explicit Provenance(std::vector<std::string> words) : words_(std::move(words)) {}
  Provenance() = default;

  void hide_paths();
  [[nodiscard]] bool hides_paths() const { return hides_; }

  void add_input(const std::filesystem::path& path);
  void add_output(const std::filesystem::path& path);

  /// The command line as it was typed, but for hidden names.
  [[nodiscard]] std::string command() const;

  /// The command for what is written: OUT.ply in place of an output's name, and without what does not shape an output
  /// (--threads, --slab, --report, --force, --quiet, --verbose). The same input, options and version then make the same
  /// bytes, whatever the output is called.
  [[nodiscard]] std::string lasting_command() const;
  /// "tunica VERSION: " and that command.
  [[nodiscard]] std::string made_by() const;

  /// The name of an input or output, without its folder, for titles.
  [[nodiscard]] std::string name_of(const std::filesystem::path& path) const;

  /// The text, with words in place of the names and folders of all files that the run knows of, where they are hidden.
  [[nodiscard]] std::string redact(std::string text) const;

private:
  struct Known {
    std::filesystem::path path;
    std::string label;
    bool output = false;
  };
  [[nodiscard]] std::string label_of(const std::string& word) const;
  void hide(const std::filesystem::path& path, const std::string& label);

  std::vector<std::string> words_;
  std::vector<Known> known_;
  std::size_t inputs_ = 0;
  std::vector<std::pair<std::string, std::string>> hidden_;  ///< what, and its label; longer ones first
  bool hides_ = false;
};

}  // namespace tunica::cli
