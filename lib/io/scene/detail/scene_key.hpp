#pragma once

#include "tunica/io/scene/detail/form.hpp"

#include <algorithm>
#include <type_traits>

/// A key of the scene is a row of schema.cpp: from it come what reads it, what writes it, the check of its range, the
/// help of its flag and its line in docs/scene.md.
namespace tunica {

/// What a key does with an Item.
template <typename Item>
struct KeyAccess {
  virtual ~KeyAccess() = default;
  /// A value as it may be written.
  [[nodiscard]] virtual std::string_view like() const = 0;
  [[nodiscard]] virtual std::optional<Range> range() const { return {}; }
  virtual void read(const SceneTable& table, const toml::node& node, Item& item) const = 0;
  /// Empty: the key is not written.
  [[nodiscard]] virtual std::string write(const Item& item, const Writing& to) const = 0;
  /// Of a number with a range: whether it lies there. Errors: as Place::fail().
  virtual void check(const Item&, const Place&) const {}
  /// As it is written where nothing is said; empty: nothing.
  [[nodiscard]] virtual std::string fallback() const { return {}; }
  /// Why the key does not belong to an item, as it is so far; empty: it belongs.
  [[nodiscard]] virtual std::string refuses(const Item&) const { return {}; }
  /// Whether a scene that is written out has it.
  [[nodiscard]] virtual bool is_written(const Item&) const { return true; }
};

/// A key of the tables that become an Item.
template <typename Item>
struct SceneKey {
  std::string_view name;
  std::string_view says;  ///< to the user, in the manual and in the help of a flag
  std::shared_ptr<const KeyAccess<Item>> access{};
  bool is_needed = false;
  bool has_default = true;
  bool decides = false;                              ///< which others belong to the item: it is read before them
  std::string_view why{};                            ///< it is needed, for the message that it is missing
  std::string_view instead{};                        ///< a key that makes this one needless
  std::string_view against{};                        ///< a key beside which this one cannot be
  std::function<std::string(const Item&)> reason{};  ///< where given, in place of the access's refuses()
  std::function<bool(const Item&)> condition{};      ///< likewise of its is_written()
  std::function<void(Item&)> more{};                 ///< done to the item once the key was read

  void read(const SceneTable& table, const toml::node& node, Item& item) const {
    access->read(table, node, item);
    if (more) {
      more(item);
    }
  }
  [[nodiscard]] std::string fallback() const { return has_default ? access->fallback() : std::string(); }
  /// Why the key does not belong to an item, as it is so far; empty: it belongs.
  [[nodiscard]] std::string refuses(const Item& item) const { return reason ? reason(item) : access->refuses(item); }
  [[nodiscard]] bool belongs(const Item& item) const { return refuses(item).empty(); }
  [[nodiscard]] bool is_written(const Item& item) const {
    return condition ? condition(item) : access->is_written(item);
  }
  [[nodiscard]] bool stands_in(const Item& item) const { return belongs(item) && is_written(item); }

  SceneKey needed(std::string_view because = {}, std::string_view unless = {}) && {
    is_needed = true;
    why = because;
    instead = unless;
    return std::move(*this).without_default();
  }
  SceneKey without_default() && {
    has_default = false;
    return std::move(*this);
  }
  SceneKey contradicting(std::string_view other) && {
    against = other;
    return std::move(*this);
  }
  SceneKey deciding() && {
    decides = true;
    return std::move(*this);
  }
  SceneKey written_if(std::function<bool(const Item&)> holds) && {
    condition = std::move(holds);
    return std::move(*this);
  }
  /// @param why_not  empty where the key belongs to the item
  SceneKey refused(std::function<std::string(const Item&)> why_not) && {
    reason = std::move(why_not);
    return std::move(*this);
  }
  /// It does not belong to items of which this holds.
  SceneKey unless(std::function<bool(const Item&)> holds, std::string why_not) && {
    return std::move(*this).refused([holds = std::move(holds), why_not = std::move(why_not)](const Item& item) {
      return holds(item) ? why_not : std::string();
    });
  }
  /// Does this to the item, once the key was read.
  SceneKey then(std::function<void(Item&)> does) && {
    more = std::move(does);
    return std::move(*this);
  }
};

template <typename Item>
using SceneKeys = std::vector<SceneKey<Item>>;

template <typename Value>
inline constexpr bool is_optional = false;
template <typename Value>
inline constexpr bool is_optional<std::optional<Value>> = true;

/// A member of an Item, in a form. @tparam Member  what returns a reference to it
template <typename Item, typename Member, typename Value>
struct MemberAccess : KeyAccess<Item> {
  static constexpr bool may_be_none = is_optional<std::decay_t<std::invoke_result_t<Member, const Item&>>>;

  std::string_view name;
  Member member;
  Form<Value> form;

  MemberAccess(std::string_view of, Member where, Form<Value> how) : name(of), member(where), form(std::move(how)) {}

  [[nodiscard]] std::string_view like() const override { return form.like; }
  [[nodiscard]] std::optional<Range> range() const override { return form.range; }
  void read(const SceneTable& table, const toml::node& node, Item& item) const override {
    std::invoke(member, item) = form.read(table, node, name);
  }
  [[nodiscard]] std::string write(const Item& item, const Writing& to) const override {
    if constexpr (may_be_none) {
      return form.write(*std::invoke(member, item), to);
    } else {
      return form.write(std::invoke(member, item), to);
    }
  }
  void check(const Item& item, const Place& place) const override {
    if constexpr (std::is_same_v<Value, double>) {
      const std::optional<double> value = std::invoke(member, item);
      if (form.range && value) {
        form.range->require(*value, place, name);
      }
    }
  }
  [[nodiscard]] std::string fallback() const override { return may_be_none ? std::string() : write(Item{}, Writing{}); }
  [[nodiscard]] bool is_written(const Item& item) const override {
    if constexpr (may_be_none) {
      return std::invoke(member, item).has_value();
    }
    return true;
  }
};

/// A key and the member that it sets. @param member  what returns a reference to it; where that is optional, the key is
/// not written without a value
template <typename Item, typename Member, typename Value>
SceneKey<Item> key(std::string_view name, Member member, const Form<Value>& form, std::string_view says = {}) {
  return {name, says, std::make_shared<const MemberAccess<Item, Member, Value>>(name, member, form)};
}

/// The same of a member of the item.
template <typename Item, typename Member, typename Value>
SceneKey<Item> key(std::string_view name, Member Item::*member, const Form<Value>& form, std::string_view says = {}) {
  return key<Item, Member Item::*>(name, member, form, says);
}

/// A part of an Item, and a key of it. @tparam Part  returns a pointer to it; null: the item has no such part
template <typename Item, typename Part, typename Key>
struct PartAccess : KeyAccess<Item> {
  using Reason = std::function<std::string(std::string_view key, const Item&)>;

  Part part;
  Key key;
  Reason reason;

  PartAccess(Part of, Key own, Reason without) : part(of), key(std::move(own)), reason(std::move(without)) {}

  [[nodiscard]] std::string_view like() const override { return key.access->like(); }
  [[nodiscard]] std::optional<Range> range() const override { return key.access->range(); }
  void read(const SceneTable& table, const toml::node& node, Item& item) const override {
    key.read(table, node, *part(item));
  }
  [[nodiscard]] std::string write(const Item& item, const Writing& to) const override {
    return key.access->write(*part(item), to);
  }
  void check(const Item& item, const Place& place) const override { key.access->check(*part(item), place); }
  [[nodiscard]] std::string fallback() const override { return key.fallback(); }
  [[nodiscard]] std::string refuses(const Item& item) const override {
    const auto* const there = part(item);
    return there == nullptr ? reason(key.name, item) : key.refuses(*there);
  }
  [[nodiscard]] bool is_written(const Item& item) const override { return key.is_written(*part(item)); }
};

/// The keys of a part of an item, among those of the item. @param part  returns a pointer to it; null: the item has no
/// such part  @param reason  why a key does not belong to an item without it
template <typename Item, typename Part, typename Access>
void append(SceneKeys<Item>& keys, const SceneKeys<Part>& of_part, const Access& part,
            const std::type_identity_t<std::function<std::string(std::string_view key, const Item&)>>& reason = {}) {
  using Own = PartAccess<Item, Access, SceneKey<Part>>;
  for (const SceneKey<Part>& own : of_part) {
    keys.push_back(SceneKey<Item>{own.name, own.says, std::make_shared<const Own>(part, own, reason), own.is_needed,
                                  own.has_default, own.decides, own.why, own.instead, own.against});
  }
}

/// Their names, each once.
template <typename Item>
std::vector<std::string_view> names_of_keys(const SceneKeys<Item>& keys) {
  std::vector<std::string_view> names;
  for (const SceneKey<Item>& key : keys) {
    if (std::ranges::find(names, key.name) == names.end()) {
      names.push_back(key.name);
    }
  }
  return names;
}

/// Reads what a table says of an item. Errors: InputError with the place: keys that are missing, that do not belong to
/// it, that contradict each other, and values that cannot be.
template <typename Item>
void read_keys(const SceneTable& table, const SceneKeys<Item>& keys, Item& item) {
  const auto refuse_foreign = [&](const SceneKey<Item>& key) {
    const auto belongs = [&](const SceneKey<Item>& other) { return other.name == key.name && other.belongs(item); };
    table.place(key.name).require(std::ranges::any_of(keys, belongs), key.refuses(item));
  };
  const auto read = [&](const SceneKey<Item>& key) {
    if (!key.against.empty() && table.has(key.against)) {
      const auto other = std::ranges::find(keys, key.against, &SceneKey<Item>::name);
      const auto [first, second] = std::minmax({&key, &*other});
      table.place(key.name).fail(std::string(first->name) + " and " + std::string(second->name) +
                                 " contradict each other: give one");
    }
    refuse_foreign(key);
    if (key.belongs(item)) {
      key.read(table, table.required(key.name), item);
    }
  };
  for (const SceneKey<Item>& key : keys) {
    if (key.decides && table.has(key.name)) {
      read(key);
    }
  }
  const bool is_decided = std::ranges::none_of(keys, [&](const SceneKey<Item>& key) {
    return key.decides && key.is_needed && !table.has(key.name) && !table.has(key.instead);
  });
  for (const SceneKey<Item>& key : keys) {
    if (is_decided && table.has(key.name)) {
      refuse_foreign(key);
    }
  }
  for (const SceneKey<Item>& key : keys) {
    if (!table.has(key.name)) {
      if (key.is_needed && key.belongs(item) && !table.has(key.instead)) {
        (void)table.required(key.name, key.why);
      }
    } else if (!key.decides) {
      read(key);
    }
  }
}

/// What a table of an item says: key and value, in TOML.
using WrittenKeys = std::vector<std::pair<std::string_view, std::string>>;
template <typename Item>
WrittenKeys written_keys(const SceneKeys<Item>& keys, const Item& item, const Writing& to) {
  WrittenKeys written;
  for (const SceneKey<Item>& key : keys) {
    const std::string value = key.stands_in(item) ? key.access->write(item, to) : "";
    if (!value.empty()) {
      written.emplace_back(key.name, value);
    }
  }
  return written;
}
/// "key = value", one each.
std::vector<std::string> lines_of(const WrittenKeys& written);

/// Whether the numbers of an item lie in their ranges. Errors: as Place::fail().
template <typename Item>
void check_keys(const SceneKeys<Item>& keys, const Item& item, const Places& places) {
  for (const SceneKey<Item>& key : keys) {
    if (key.stands_in(item)) {
      key.access->check(item, places.of(key.name));
    }
  }
}

namespace form {

/// The table that a node must be. Errors: it is none.
const toml::table& table_of(const SceneTable& table, const toml::node& node, std::string_view key,
                            std::string_view like);
std::string braced(const std::vector<std::string>& lines);

/// A table within a line.
template <typename Item>
Form<Item> inner(const SceneKeys<Item>& keys, std::string like) {
  return {like,
          [keys, like](const SceneTable& table, const toml::node& node, std::string_view key) {
            const SceneTable own(table_of(table, node, key, like), table.source(), std::string(key),
                                 names_of_keys(keys));
            Item item{};
            read_keys(own, keys, item);
            return item;
          },
          [keys](const Item& item, const Writing& to) { return braced(lines_of(written_keys(keys, item, to))); }};
}

}  // namespace form
}  // namespace tunica
