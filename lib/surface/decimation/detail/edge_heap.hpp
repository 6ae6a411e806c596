#pragma once

#include "tunica/core/narrow.hpp"
#include "tunica/core/types.hpp"

#include <utility>
#include <vector>

namespace tunica {

/// A priority queue of items 0 … n − 1 that can change or remove any of them: a heap with four children per node and
/// each item's place in it. Of equal keys the lower item comes first, so the order of extraction is determined.
class EdgeHeap {
public:
  explicit EdgeHeap(std::size_t items) : place_(items, absent) {}

  [[nodiscard]] bool empty() const { return heap_.empty(); }
  [[nodiscard]] double top_key() const { return heap_.front().key; }
  [[nodiscard]] Index top() const { return heap_.front().item; }
  [[nodiscard]] bool contains(Index item) const { return place_[item] != absent; }

  /// Appends without order; call order() before anything else.
  void append(Index item, double key) {
    place_[item] = narrow<Index>(heap_.size());
    heap_.push_back({key, item});
  }

  void order() {
    for (std::size_t i = heap_.size() / 4 + 1; i-- > 0;) {
      if (i < heap_.size()) {
        sink(i);
      }
    }
  }

  /// Inserts the item or changes its key.
  void set(Index item, double key) {
    if (!contains(item)) {
      append(item, key);
      rise(heap_.size() - 1);
      return;
    }
    const std::size_t i = place_[item];
    const bool up = before({key, item}, heap_[i]);
    heap_[i].key = key;
    if (up) {
      rise(i);
    } else {
      sink(i);
    }
  }

  void remove(Index item) {
    if (!contains(item)) {
      return;
    }
    const std::size_t i = place_[item];
    place_[item] = absent;
    const Entry last = heap_.back();
    heap_.pop_back();
    if (i < heap_.size()) {
      const bool up = before(last, heap_[i]);
      put(i, last);
      if (up) {
        rise(i);
      } else {
        sink(i);
      }
    }
  }

private:
  struct Entry {
    double key;
    Index item;
  };
  static constexpr Index absent = 0xffffffff;

  static bool before(const Entry& l, const Entry& r) { return l.key < r.key || (l.key == r.key && l.item < r.item); }

  void put(std::size_t i, const Entry& entry) {
    heap_[i] = entry;
    place_[entry.item] = narrow<Index>(i);
  }

  void rise(std::size_t i) {
    const Entry entry = heap_[i];
    while (i > 0 && before(entry, heap_[(i - 1) / 4])) {
      put(i, heap_[(i - 1) / 4]);
      i = (i - 1) / 4;
    }
    put(i, entry);
  }

  void sink(std::size_t i) {
    const Entry entry = heap_[i];
    while (4 * i + 1 < heap_.size()) {
      std::size_t least = 4 * i + 1;
      for (std::size_t child = least + 1; child < std::min(4 * i + 5, heap_.size()); ++child) {
        if (before(heap_[child], heap_[least])) {
          least = child;
        }
      }
      if (!before(heap_[least], entry)) {
        break;
      }
      put(i, heap_[least]);
      i = least;
    }
    put(i, entry);
  }

  std::vector<Entry> heap_;
  std::vector<Index> place_;
};

}  // namespace tunica
