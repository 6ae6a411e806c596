#pragma once

#include "tunica/io/scene/detail/form.hpp"

#include <algorithm>
#include <tuple>
#include <type_traits>

/// A key of the scene is a row of schema.cpp: from it come what reads it, what writes it, the check of its range, the
/// help of its flag and its line in docs/scene.md.
namespace tunica {

/// A key of the tables that become an Item.
template <typename Item>
struct SceneKey {
  std::string_view name;
  std::string says;  ///< to the user, in the manual and in the help of a flag
  std::string like;  ///< a value as it may be written
  std::optional<Range> range{};
  Shared<void(const SceneTable&, const toml::node&, Item&)> read{};
  Shared<std::string(const Item&, const Writing&)> write{};  ///< empty: the key is not written
  /// Of a number with a range: whether it lies there.
  Shared<void(const Item&, const Place&)> check{};
  /// As it is written where nothing is said; empty: nothing.
  Shared<std::string()> fallback{};
  /// Why the key does not belong to an item, as it is so far; empty: it belongs.
  Shared<std::string(const Item&)> refuses{};
  /// Whether a scene that is written out has it; none: always.
  Shared<bool(const Item&)> is_written{};
  bool is_needed = false;
  std::string_view why{};      ///< it is needed, for the message that it is missing
  std::string_view instead{};  ///< a key that makes this one needless
  std::string_view against{};  ///< a key beside which this one cannot be
  bool decides = false;        ///< which others belong to the item: it is read before them

  [[nodiscard]] bool belongs(const Item& item) const { return !refuses || refuses(item).empty(); }
  [[nodiscard]] bool stands_in(const Item& item) const { return belongs(item) && (!is_written || is_written(item)); }

  SceneKey needed(std::string_view because = {}, std::string_view unless = {}) && {
    is_needed = true;
    why = because;
    instead = unless;
    return std::move(*this).without_default();
  }
  SceneKey without_default() && {
    fallback = {};
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
  SceneKey written_if(std::function<bool(const Item&)> condition) && {
    is_written = std::move(condition);
    return std::move(*this);
  }
  /// @param reason  empty where the key belongs to the item
  SceneKey refused(std::function<std::string(const Item&)> reason) && {
    refuses = std::move(reason);
    return std::move(*this);
  }
  /// It does not belong to items of which this holds.
  SceneKey unless(std::function<bool(const Item&)> condition, std::string reason) && {
    return std::move(*this).refused([condition = std::move(condition), reason = std::move(reason)](const Item& item) {
      return condition(item) ? reason : std::string();
    });
  }
  /// Does this to the item, once the key was read.
  SceneKey then(std::function<void(Item&)> more) && {
    read = [before = std::move(read), more = std::move(more)](const SceneTable& table, const toml::node& node,
                                                              Item& item) {
      before(table, node, item);
      more(item);
    };
    return std::move(*this);
  }
};

template <typename Item>
using SceneKeys = std::vector<SceneKey<Item>>;

template <typename Value>
inline constexpr bool is_optional = false;
template <typename Value>
inline constexpr bool is_optional<std::optional<Value>> = true;

/// A key and the member that it sets. @param member  what returns a reference to it; where that is optional, the key is
/// not written without a value
template <typename Item, typename Member, typename Value>
SceneKey<Item> key(std::string_view name, Member member, const Form<Value>& form, std::string says = {}) {
  SceneKey<Item> key{name, std::move(says), form.like, form.range};
  key.read = [=](const SceneTable& table, const toml::node& node, Item& item) {
    std::invoke(member, item) = form.read(table, node, name);
  };
  if constexpr (is_optional<std::decay_t<std::invoke_result_t<Member, const Item&>>>) {
    key.write = [=](const Item& item, const Writing& to) { return form.write(*std::invoke(member, item), to); };
    key.is_written = [=](const Item& item) { return std::invoke(member, item).has_value(); };
  } else {
    key.write = [=](const Item& item, const Writing& to) { return form.write(std::invoke(member, item), to); };
    key.fallback = [=] {
      const Item item{};
      return form.write(std::invoke(member, item), Writing{});
    };
  }
  if constexpr (std::is_same_v<Value, double>) {
    if (form.range) {
      key.check = [=](const Item& item, const Place& place) {
        const std::optional<double> value = std::invoke(member, item);
        if (value) {
          form.range->require(*value, place, name);
        }
      };
    }
  }
  return key;
}

/// The same of a member of the item.
template <typename Item, typename Member, typename Value>
SceneKey<Item> key(std::string_view name, Member Item::*member, const Form<Value>& form, std::string says = {}) {
  return key<Item, Member Item::*>(name, member, form, std::move(says));
}

/// The keys of a part of an item, among those of the item. @param part  returns a pointer to it; null: the item has no
/// such part  @param reason  why a key does not belong to an item without it
template <typename Item, typename Part, typename Access>
void append(SceneKeys<Item>& keys, const SceneKeys<Part>& of_part, const Access& part,
            const std::type_identity_t<std::function<std::string(std::string_view key, const Item&)>>& reason = {}) {
  for (const SceneKey<Part>& own : of_part) {
    SceneKey<Item> key{own.name, own.says, own.like, own.range};
    key.fallback = own.fallback;
    std::tie(key.is_needed, key.why, key.instead) = std::tie(own.is_needed, own.why, own.instead);
    std::tie(key.against, key.decides) = std::tie(own.against, own.decides);
    key.read = [=](const SceneTable& table, const toml::node& node, Item& item) { own.read(table, node, *part(item)); };
    key.write = [=](const Item& item, const Writing& to) { return own.write(*part(item), to); };
    if (own.check) {
      key.check = [=](const Item& item, const Place& place) { own.check(*part(item), place); };
    }
    key.refuses = [=](const Item& item) {
      const Part* const there = part(item);
      return there == nullptr ? reason(own.name, item) : own.refuses ? own.refuses(*there) : std::string();
    };
    if (own.is_written) {
      key.is_written = [=](const Item& item) { return own.is_written(*part(item)); };
    }
    keys.push_back(std::move(key));
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
    table.place(key.name).require(std::ranges::any_of(keys, belongs), key.refuses ? key.refuses(item) : "");
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

/// What a table of an item says.
template <typename Item>
std::vector<std::string> written_keys(const SceneKeys<Item>& keys, const Item& item, const Writing& to) {
  std::vector<std::string> lines;
  for (const SceneKey<Item>& key : keys) {
    const std::string value = key.stands_in(item) ? key.write(item, to) : "";
    if (!value.empty()) {
      lines.push_back(std::string(key.name) + " = " + value);
    }
  }
  return lines;
}

/// Whether the numbers of an item lie in their ranges. Errors: as Place::fail().
template <typename Item>
void check_keys(const SceneKeys<Item>& keys, const Item& item, const Places& places) {
  for (const SceneKey<Item>& key : keys) {
    if (key.check && key.stands_in(item)) {
      key.check(item, places.of(key.name));
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
          [keys](const Item& item, const Writing& to) { return braced(written_keys(keys, item, to)); }};
}

}  // namespace form
}  // namespace tunica
