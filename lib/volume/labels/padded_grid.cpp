#include "tunica/volume/labels/padded_grid.hpp"

#include "tunica/core/error.hpp"
#include "tunica/core/narrow.hpp"

namespace tunica::cell_layers {

PaddedGrid::PaddedGrid(const Mask& mask, const Window& window, bool open, const BorderLids* lids)
    : mask_(mask), window_(window), lids_(lids) {
  TUNICA_ASSERT(window.first[0] == 0 && window.size[0] == mask.dims()[0]);
  for (int axis = 0; axis < 3; ++axis) {
    size_[axis] = window.size[axis] + 2;
    open_[axis] = {open && window.first[axis] == 0,
                   open && window.first[axis] + window.size[axis] == mask.dims()[axis]};
  }
  const auto first_bits = [](std::size_t count, std::size_t w) {
    const std::size_t before = w * word_bits;
    return count >= before + word_bits ? ~Word{0} : count <= before ? Word{0} : (Word{1} << (count - before)) - 1;
  };
  const std::size_t words = size_[0] / word_bits + 1;
  for (std::size_t w = 0; w < words; ++w) {
    samples_.push_back(first_bits(size_[0], w));
    cells_.push_back(first_bits(size_[0] - 1, w));
    ends_.push_back((samples_[w] ^ cells_[w]) | (w == 0 ? 1 : 0));
  }
}

void PaddedGrid::load(std::size_t slice, Word* out, std::uint8_t* inside) const {
  const auto beyond = [&](std::size_t at, int axis) {
    return (at == 0 && !open_[axis][0]) || (at == size_[axis] - 1 && !open_[axis][1]);
  };
  const std::size_t rows = size_[1];
  const std::size_t words = samples_.size();
  const std::size_t given = mask_.words_per_row();
  const bool open = is_open();
  const bool empty = beyond(slice, 2);
  const Word* const first = mask_.row(window_.first[1], in_image(slice, 2));
  for (std::size_t row = 0; row < rows; ++row, out += words) {
    const Word* const in = first + given * (std::clamp<std::size_t>(row, 1, rows - 2) - 1);
    Word any = 0;
    if (!empty && ((row > 0 && row < rows - 1) || !beyond(row, 1))) {
      for (std::size_t w = 0; w < given; ++w) {
        any |= in[w];
      }
    }
    if (any == 0) {
      if (inside[row] != 0) {
        std::fill_n(out, words, Word{0});
        inside[row] = 0;
      }
      continue;
    }
    inside[row] = 1;
    Word carry = 0;
    for (std::size_t w = 0; w < given; ++w) {
      out[w] = in[w] << 1 | carry;
      carry = in[w] >> (word_bits - 1);
    }
    if (given < words) {
      out[given] = carry;
    }
    if (lids_ != nullptr) {
      put_lids(out, 2, slice, in_image(row, 1));
      put_lids(out, 1, row, in_image(slice, 2));
    }
    if (open) {
      continue_row(out, row, slice);
    }
  }
}

void PaddedGrid::put_lids(Word* out, int axis, std::size_t padded, std::size_t other) const {
  if (!is_padding(padded, axis)) {
    return;
  }
  const std::vector<bool>& closed = lids_->closed[axis][padded == 0 ? 0 : 1];
  for (std::size_t i = 0; !closed.empty() && i < mask_.dims()[0]; ++i) {
    if (closed[i + mask_.dims()[0] * other]) {
      out[(i + 1) / word_bits] &= ~(Word{1} << ((i + 1) % word_bits));
    }
  }
}

void PaddedGrid::continue_row(Word* row, std::size_t padded_row, std::size_t slice) const {
  const std::size_t at = in_image(padded_row, 1) + mask_.dims()[1] * in_image(slice, 2);
  const auto has_lid = [&](std::size_t side) {
    return lids_ != nullptr && !lids_->closed[0][side].empty() && lids_->closed[0][side][at];
  };
  const auto copy = [row](std::size_t from, std::size_t to) {
    row[to / word_bits] |= (row[from / word_bits] >> (from % word_bits) & 1) << (to % word_bits);
  };
  if (open_[0][0] && !has_lid(0)) {
    copy(1, 0);
  }
  if (open_[0][1] && !has_lid(1)) {
    copy(size_[0] - 2, size_[0] - 1);
    copy(size_[0] - 1, size_[0]);
  }
}

std::size_t PaddedGrid::at_hand(const std::array<std::size_t, 3>& padded) const {
  const auto& dims = mask_.dims();
  return in_image(padded[0], 0) +
         dims[0] * (in_image(padded[1], 1) + dims[1] * (in_image(padded[2], 2) - window_.first_slice));
}

std::size_t PaddedGrid::number(const std::array<std::size_t, 3>& padded) const {
  const auto& dims = mask_.dims();
  const auto in_padded_image = [&](int axis) { return padded[axis] + window_.first[axis]; };
  return in_padded_image(0) + (dims[0] + 2) * (in_padded_image(1) + (dims[1] + 2) * in_padded_image(2));
}

double PaddedGrid::coordinate(std::size_t padded, int axis) const {
  if (padded == 0 && open_[axis][0]) {
    return -0.5;
  }
  if (padded == size_[axis] - 1 && open_[axis][1]) {
    return real(mask_.dims()[axis]) - 0.5;
  }
  return real(window_.first[axis]) - 1 + real(padded);
}

}  // namespace tunica::cell_layers
