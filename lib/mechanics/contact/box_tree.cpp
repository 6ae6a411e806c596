#include "tunica/mechanics/contact/detail/box_tree.hpp"

#include <algorithm>
#include <numeric>

namespace tunica {
namespace {

constexpr std::size_t leaf_size = 8;

}  // namespace

BoxTree::BoxTree(std::vector<std::size_t> faces, const std::vector<Bounds>& boxes) : faces_(std::move(faces)) {
  boxes_.reserve(faces_.size());
  for (const std::size_t f : faces_) {
    boxes_.push_back(boxes[f]);
  }
  if (!faces_.empty()) {
    nodes_.reserve(faces_.size() / (leaf_size / 4) + 1);
    build(0, faces_.size());
  }
}

void BoxTree::build(std::size_t begin, std::size_t end) {
  const std::size_t number = nodes_.size();
  Bounds box = boxes_[begin];
  for (std::size_t i = begin; i < end; ++i) {
    box.lower = box.lower.cwiseMin(boxes_[i].lower);
    box.upper = box.upper.cwiseMax(boxes_[i].upper);
  }
  nodes_.push_back({box, begin, end, 0});
  if (end - begin <= leaf_size) {
    return;
  }
  Eigen::Index axis = 0;
  (box.upper - box.lower).maxCoeff(&axis);
  std::vector<std::size_t> order(end - begin);
  std::iota(order.begin(), order.end(), begin);
  const auto middle_of = [&](std::size_t i) {
    return std::pair(boxes_[i].lower[axis] + boxes_[i].upper[axis], faces_[i]);
  };
  const auto half = order.begin() + narrow<std::ptrdiff_t>(order.size() / 2);
  std::nth_element(order.begin(), half, order.end(),
                   [&](std::size_t a, std::size_t b) { return middle_of(a) < middle_of(b); });
  std::vector<std::size_t> faces;
  std::vector<Bounds> boxes;
  for (const std::size_t i : order) {
    faces.push_back(faces_[i]);
    boxes.push_back(boxes_[i]);
  }
  std::copy(faces.begin(), faces.end(), faces_.begin() + narrow<std::ptrdiff_t>(begin));
  std::copy(boxes.begin(), boxes.end(), boxes_.begin() + narrow<std::ptrdiff_t>(begin));
  const std::size_t middle = begin + order.size() / 2;
  build(begin, middle);
  nodes_[number].second = nodes_.size();
  build(middle, end);
}

void BoxTree::refit(const std::vector<Bounds>& boxes) {
  for (std::size_t i = 0; i < faces_.size(); ++i) {
    boxes_[i] = boxes[faces_[i]];
  }
  for (std::size_t number = nodes_.size(); number-- > 0;) {  // children come after their parents
    Node& node = nodes_[number];
    const auto add = [&](const Bounds& box) {
      node.box.lower = node.box.lower.cwiseMin(box.lower);
      node.box.upper = node.box.upper.cwiseMax(box.upper);
    };
    node.box = node.second == 0 ? boxes_[node.begin] : nodes_[number + 1].box;
    if (node.second != 0) {
      add(nodes_[node.second].box);
    }
    for (std::size_t i = node.begin; node.second == 0 && i < node.end; ++i) {
      add(boxes_[i]);
    }
  }
}

}  // namespace tunica
