#pragma once

#include "tunica/core/names.hpp"
#include "tunica/core/narrow.hpp"
#include "tunica/io/scene/detail/scene_table.hpp"

#include <concepts>
#include <functional>
#include <memory>

namespace tunica {

/// The scene that is being written, and where to.
struct Writing {
  const Scene* scene = nullptr;
  std::filesystem::path folder{};  ///< what lies in it is named relative to it; empty: paths are absolute

  [[nodiscard]] bool over_time() const { return std::holds_alternative<DynamicRun>(scene->run.kind); }
};

/// Where numbers must lie, ends excluded unless said, and what is said of others: {key} and {value} stand for these.
struct Range {
  double low, high;
  std::string_view otherwise;
  bool with_low = false, with_high = false;

  [[nodiscard]] bool contains(double value) const {
    return (value > low || (with_low && value == low)) && (value < high || (with_high && value == high));
  }
  /// "above 0", "from 0", "in (-1, 0.5)"
  [[nodiscard]] std::string text() const;
  /// Errors: as Place::fail(): the value lies outside.
  void require(double value, const Place& place, std::string_view key) const;
};
inline constexpr Range positive{0, infinity, "{key} must be greater than zero"};
inline constexpr Range not_negative{0, infinity, "{key} must not be negative", true};

/// A function that its copies share. Functions of a row hold those of its parts, which hold those of theirs: copied as
/// wholes, each would hold all of them anew.
template <typename Signature>
class Shared {
public:
  Shared() = default;
  template <typename Function>
  requires std::convertible_to<Function, std::function<Signature>> Shared(Function function)
      : function_(std::make_shared<const std::function<Signature>>(std::move(function))) {}

  explicit operator bool() const { return function_ != nullptr && *function_; }
  template <typename... Arguments>
  auto operator()(Arguments&&... arguments) const {
    return (*function_)(std::forward<Arguments>(arguments)...);
  }

private:
  std::shared_ptr<const std::function<Signature>> function_;
};

/// How a value stands in a scene file: read as it was written, whatever it is.
template <typename Value>
struct Form {
  std::string like;  ///< as it may be written, for messages and the manual
  Shared<Value(const SceneTable&, const toml::node&, std::string_view key)> read{};
  Shared<std::string(const Value&, const Writing&)> write{};
  std::optional<Range> range{};  ///< of numbers

  /// The same for values that pass alone. @param check  (value, place, key)
  template <typename Check>
  [[nodiscard]] Form checked(const Check& check) const {
    Form form = *this;
    form.read = [plain = read, check](const SceneTable& table, const toml::node& node, std::string_view key) {
      Value value = plain(table, node, key);
      check(value, table.at(node), key);
      return value;
    };
    return form;
  }
  /// The same for numbers of that range alone.
  [[nodiscard]] Form in(const Range& wanted) const {
    Form form = checked(
        [wanted](double value, const Place& place, std::string_view key) { wanted.require(value, place, key); });
    form.range = wanted;
    return form;
  }
};

/// The forms of values. Errors of all: as SceneTable, at the value's own place.
namespace form {

/// What is made of another value, and that value of it.
template <typename From, typename Make, typename Unmake>
auto made_of(const Form<From>& form, const Make& make, const Unmake& unmake) {
  using Value = std::invoke_result_t<Make, From>;
  return Form<Value>{form.like,
                     [=](const SceneTable& table, const toml::node& node, std::string_view key) {
                       return make(form.read(table, node, key));
                     },
                     [=](const Value& value, const Writing& to) { return form.write(unmake(value), to); }};
}

/// The elements of a list. Errors: it is none, or not of `count` elements where that is not 0.
const toml::array& array_of(const SceneTable& table, const toml::node& node, std::string_view key, std::size_t count,
                            std::string_view what, std::string_view like);

/// A text in quotes.
Form<std::string> text(std::string_view like);
/// Relative to the scene's folder.
Form<std::filesystem::path> file(std::string_view like);
/// Without a unit.
Form<double> number(std::string_view like);
/// A text with a percent sign, or a plain part of 1.
Form<double> part(std::string_view like);
Form<bool> flag();
/// A whole number from 1 to `most`.
Form<std::size_t> count(std::int64_t most = 1'000'000'000);
/// @param unit  in which it is written
Form<double> quantity(Dimension dimension, std::string_view unit, std::string_view like);
/// An angle in degrees, rad in here.
Form<double> angle(std::string_view like);
/// A list of so many values, 0: of any number. @param what  it must be, for the message that it is not
template <typename Value>
Form<std::vector<Value>> list_of(const Form<Value>& value, std::size_t count, std::string_view what,
                                 std::string_view like) {
  return {std::string(like),
          [=](const SceneTable& table, const toml::node& node, std::string_view key) {
            std::vector<Value> values;
            for (const toml::node& one : array_of(table, node, key, count, what, like)) {
              values.push_back(value.read(table, one, key));
            }
            return values;
          },
          [=](const std::vector<Value>& values, const Writing& to) {
            std::string text;
            for (const Value& one : values) {
              text += (text.empty() ? "" : ", ") + value.write(one, to);
            }
            return "[" + text + "]";
          }};
}

/// Three quantities.
Form<Vec3> vector(Dimension dimension, std::string_view unit, std::string_view like);
/// Three plain numbers, made a unit vector.
Form<Vec3> direction();
/// Size in mm of a unit of length.
Form<double> unit_of_length();
Form<LengthTolerance> length_tolerance(std::string_view like);
/// Which of three axes: "xz"; "" for none.
Form<std::array<bool, 3>> axes();
Form<std::array<std::string, 2>> two_names(std::string_view like);
Form<std::vector<double>> increasing_numbers(std::string_view like);
Form<std::map<std::string, std::filesystem::path>> files_by_name(std::string_view like);
/// @param carried  by another body: {touching = …} is understood too
Form<Selection> selection(bool carried = false);
/// Factors over time, or in a static run over the load factor.
Form<Ramp> ramp();
/// One value, or a table of values over time.
Form<Table<double>> over_time(const Form<double>& value);
Form<Table<Vec3>> over_time(const Form<Vec3>& value);

/// The number in `words` of the word that a text says. Errors: it says another.
std::size_t number_of_word(const SceneTable& table, const toml::node& node, std::string_view key,
                           const std::vector<std::string_view>& words);
/// A text, in quotes.
std::string in_quotes(std::string_view text);
/// `"one" (a note) | "other"`
template <typename Value>
std::string alternatives(const std::vector<Named<Value>>& names) {
  std::string all;
  for (const Named<Value>& named : names) {
    const std::string note(named.note);
    all += (all.empty() ? "" : " | ") + in_quotes(named.word) + (note.empty() ? "" : " (" + note + ")");
  }
  return all;
}

/// One of some words.
template <typename Value>
Form<Value> choice(const std::vector<Named<Value>>& names) {
  std::vector<std::string_view> words;
  for (const Named<Value>& named : names) {
    words.push_back(named.word);
  }
  return {alternatives(names),
          [names, words](const SceneTable& table, const toml::node& node, std::string_view key) {
            return names[number_of_word(table, node, key, words)].value;
          },
          [names](const Value& value, const Writing&) {
            for (const Named<Value>& named : names) {
              if (named.value == value) {
                return in_quotes(named.word);
              }
            }
            return std::string();
          }};
}

/// One of the names of an enumeration.
template <typename Value>
Form<Value> choice() {
  return choice(std::vector<Named<Value>>(names_of<Value>.begin(), names_of<Value>.end()));
}

/// An axis by its name.
inline Form<int> axis() { return choice<int>({{"x", 0}, {"y", 1}, {"z", 2}}); }

/// One of the kinds of a variant, each by a value of it.
template <typename Variant>
Form<Variant> one_of_kinds(const std::vector<Named<Variant>>& kinds) {
  std::vector<Named<std::size_t>> names;
  for (const Named<Variant>& kind : kinds) {
    names.push_back({kind.word, names.size()});
  }
  return made_of(
      choice(names), [kinds](std::size_t number) { return kinds[number].value; },
      [kinds](const Variant& variant) {
        const auto is_such = [&](const Named<Variant>& kind) { return kind.value.index() == variant.index(); };
        return narrow<std::size_t>(std::ranges::find_if(kinds, is_such) - kinds.begin());
      });
}

}  // namespace form
}  // namespace tunica
