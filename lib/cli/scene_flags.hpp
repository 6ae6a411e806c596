#pragma once

#include "tunica/cli/tool.hpp"
#include "tunica/core/error.hpp"
#include "tunica/io/scene/scene.hpp"

#include <algorithm>
#include <span>

namespace tunica::cli {

/// What flags say of a scene without a file: one shell under pressure.
struct SceneFlags {
  std::optional<double> young, thickness, density, pressure, imaged_at, support, duration, step, ramp;
  std::optional<std::string> poisson, mesh_unit, membrane, bending, solver, cg_tolerance, converge;
  std::optional<std::string> load_steps, cg_iterations, every;
  std::vector<std::string> fixes;
  bool is_static = false;

  /// All of them: what a scene file says itself.
  static constexpr std::array names{
      "--young",        "--poisson",       "--thickness", "--density", "--pressure",  "--fix",       "--static",
      "--load-steps",   "--duration",      "--step",      "--ramp",    "--membrane",  "--bending",   "--solver",
      "--cg-tolerance", "--cg-iterations", "--converge",  "--every",   "--mesh-unit", "--imaged-at", "--support"};

  void declare(Tool& tool);

  /// The scene that they describe. Errors: UsageError.
  [[nodiscard]] Scene scene(const std::filesystem::path& mesh) const;

  /// Nothing but the pressure of the image acts.
  [[nodiscard]] bool pressure_is_imaged() const;

  /// Notes in the scene that they describe how its quantities were written.
  static void keep_typed(const CLI::App& app, Scene& scene);
};

/// How accurate the answer is to be.
struct AccuracyFlags {
  std::optional<std::string> within, of, max_shells;
  std::optional<double> max_seconds;
  std::optional<std::filesystem::path> target, shell_out;

  void declare(Tool& tool);

  /// Puts what they ask for into the scene. Errors: UsageError: flags without --accuracy, a scene that asks already.
  void ask(const CLI::App& app, Scene& scene) const;
};

/// "below z=-10mm", "above x = 3cm"; none where a text is not of this form. Errors: UsageError: no length stands there.
/// @param flag  for messages
std::optional<HalfSpaceNodes> parse_half_space(const std::string& text, const char* flag);

/// A whole number from 1 to `most`; none where the flag was not given. Errors: UsageError.
std::optional<std::size_t> count_of(const std::optional<std::string>& text, const char* flag, double most);

/// Degrees in a range; none where the flag was not given. Errors: UsageError.
std::optional<double> degrees_of(const std::optional<std::string>& text, const char* flag, double least, double most);

/// The words of choices, one after the other.
template <typename Choices>
std::string words_of(const Choices& choices, const std::string& between) {
  std::string words;
  for (const auto& named : choices) {
    words += (words.empty() ? "" : between) + std::string(named.word);
  }
  return words;
}

/// The choice that a word names. Errors: UsageError with all of them.
template <typename Value>
void choose(const std::optional<std::string>& word, const char* flag, Value& value,
            std::span<const Named<Value>> choices = names_of<Value>) {
  const auto found = std::ranges::find(choices, word.value_or(""), &Named<Value>::word);
  if (word && found == choices.end()) {
    throw UsageError(flag + (": '" + *word) + "' is not one of " + words_of(choices, ", "));
  }
  value = word ? found->value : value;
}

}  // namespace tunica::cli
