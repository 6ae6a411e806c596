#include "tunica/draw/picture.hpp"

#include "io_picture/shapes.hpp"
#include "support/temporary_folder.hpp"
#include "tunica/core/error.hpp"
#include "tunica/core/threads.hpp"
#include "tunica/io/file/output_file.hpp"

#include <gtest/gtest.h>
#include <png.h>
#include <opencv2/imgproc.hpp>

#include <algorithm>
#include <cmath>
#include <filesystem>

namespace tunica {
namespace {
namespace fs = std::filesystem;

cv::Mat read_png(const fs::path& path) {
  png_image header{};
  header.version = PNG_IMAGE_VERSION;
  EXPECT_NE(png_image_begin_read_from_file(&header, path.c_str()), 0) << header.message;
  EXPECT_EQ(header.format, PNG_FORMAT_RGB);
  header.format = PNG_FORMAT_BGR;
  cv::Mat image(static_cast<int>(header.height), static_cast<int>(header.width), CV_8UC3);
  EXPECT_NE(png_image_finish_read(&header, nullptr, image.data, 0, nullptr), 0) << header.message;
  return image;
}

class Picture : public testing::Test {
protected:
  cv::Mat picture(const TriangleMesh& mesh, const std::vector<double>& values, const PictureOptions& options = {}) {
    write_file(folder_ / "map.png", error_map_picture(mesh, values, options), true);
    return read_png(folder_ / "map.png");
  }

  test::TemporaryFolder folder_;
};

// Values 0 … 2 mm, largest at the vertex that lies farthest along `direction`.
std::vector<double> bump(const TriangleMesh& mesh, const Vec3& direction) {
  std::vector<double> values;
  for (const Vec3& p : mesh.vertices) {
    values.push_back(2 * std::exp(-4 * (p.normalized() - direction.normalized()).squaredNorm()));
  }
  return values;
}

int count_near(const cv::Mat& image, const cv::Rect& area, const cv::Vec3b& colour, int reach) {
  int count = 0;
  for (int y = area.y; y < area.y + area.height; ++y) {
    for (int x = area.x; x < area.x + area.width; ++x) {
      const cv::Vec3b pixel = image.at<cv::Vec3b>(y, x);
      bool near = true;
      for (int c = 0; c < 3; ++c) {
        near = near && std::abs(int(pixel[c]) - int(colour[c])) <= reach;
      }
      count += near ? 1 : 0;
    }
  }
  return count;
}

const cv::Rect left_view(30, 110, 620, 740);
const cv::Rect right_view(690, 110, 620, 740);
const cv::Rect bar(1432, 190, 34, 610);
const cv::Vec3b ring(40, 40, 230);

TEST_F(Picture, is_a_png_of_the_promised_size_with_both_views_and_the_bar) {
  const TriangleMesh sphere = make_sphere(20, 4);
  const cv::Mat image = picture(sphere, bump(sphere, {1, 2, 0.5}), {.title = "sphere", .diagonal = 69.3});
  ASSERT_EQ(image.size(), cv::Size(1600, 900));
  ASSERT_EQ(image.type(), CV_8UC3);
  const cv::Vec3b white(255, 255, 255);
  EXPECT_LT(count_near(image, left_view, white, 3), 0.7 * left_view.area());
  EXPECT_LT(count_near(image, right_view, white, 3), 0.7 * right_view.area());
  EXPECT_EQ(count_near(image, bar, white, 3), 0);
  EXPECT_GT(count_near(image, cv::Rect(0, 20, 1000, 50), cv::Vec3b(25, 25, 25), 60), 500) << "no title";
}

TEST_F(Picture, bar_runs_from_the_colour_of_zero_to_the_colour_of_the_largest_value) {
  const TriangleMesh sphere = make_sphere(20, 4);
  const cv::Mat image = picture(sphere, bump(sphere, {1, 2, 0.5}));
  const cv::Vec3b top = image.at<cv::Vec3b>(bar.y + 2, bar.x + 17);
  const cv::Vec3b bottom = image.at<cv::Vec3b>(bar.y + bar.height - 3, bar.x + 17);
  // Viridis: dark violet to yellow; blue, green, red.
  EXPECT_GT(top[1], 200);
  EXPECT_GT(top[2], 200);
  EXPECT_LT(top[0], 120);
  EXPECT_GT(bottom[0], bottom[1]);
  EXPECT_LT(bottom[1], 80);
  EXPECT_GT(count_near(image, left_view, top, 30), 50) << "the largest value is not seen in the first view";
  EXPECT_GT(count_near(image, right_view, bottom, 30), 5000);
}

TEST_F(Picture, first_view_shows_and_rings_the_largest_value_from_any_side) {
  const TriangleMesh sphere = make_sphere(20, 4);
  for (const Vec3& side : {Vec3(0, -1, 0), Vec3(0, 1, 0), Vec3(0.3, -1, 0.2)}) {
    const cv::Mat image = picture(sphere, bump(sphere, side));
    EXPECT_GT(count_near(image, left_view, ring, 25), 60);
    EXPECT_LT(count_near(image, right_view, ring, 25), 5);
  }
}

TEST_F(Picture, faces_that_point_inward_look_the_same) {
  const TriangleMesh sphere = make_sphere(20, 3);
  TriangleMesh inward = sphere;
  for (auto& triangle : inward.triangles) {
    std::swap(triangle[1], triangle[2]);
  }
  const cv::Mat a = picture(sphere, bump(sphere, {0.2, 1, 0}));
  const cv::Mat b = picture(inward, bump(sphere, {0.2, 1, 0}));
  EXPECT_LT(cv::norm(a, b, cv::NORM_L1) / static_cast<double>(a.total()), 0.5);
}

TEST_F(Picture, same_bytes_whatever_the_number_of_threads) {
  const TriangleMesh sphere = make_sphere(20, 5);
  PictureOptions options{.title = "a", .diagonal = 60};
  set_thread_count(1);
  const std::string one = error_map_picture(sphere, bump(sphere, {1, 1, 1}), options);
  set_thread_count(4);
  const std::string four = error_map_picture(sphere, bump(sphere, {1, 1, 1}), options);
  set_thread_count(default_thread_count());
  EXPECT_EQ(one, four);
}

TEST_F(Picture, values_without_a_range_or_without_a_number_are_drawn) {
  const TriangleMesh box = make_box();
  EXPECT_FALSE(picture(box, std::vector<double>(8, 0), {.diagonal = 3.4}).empty());
  EXPECT_FALSE(picture(box, std::vector<double>(8, std::nan("")), {.diagonal = 3.4}).empty());
  EXPECT_FALSE(picture(box, std::vector<double>(8, 1e-300), {.diagonal = 3.4}).empty());
  EXPECT_FALSE(picture(box, std::vector<double>(8, 1e300), {.diagonal = 3.4}).empty());
  std::vector<double> infinite(8, 1);
  infinite[3] = std::numeric_limits<double>::infinity();
  EXPECT_FALSE(picture(box, infinite).empty());
}

TEST_F(Picture, surface_without_extent_or_of_one_triangle_is_drawn) {
  TriangleMesh point;
  point.vertices = {{1, 2, 3}, {1, 2, 3}, {1, 2, 3}};
  point.triangles = {{0, 1, 2}};
  EXPECT_FALSE(picture(point, {0, 1, 2}).empty());
  TriangleMesh line = point;
  line.vertices[1] = {5, 2, 3};
  EXPECT_FALSE(picture(line, {0, 1, 2}).empty());
  TriangleMesh far = make_box();
  for (Vec3& vertex : far.vertices) {
    vertex = 1e-6 * vertex + Vec3(1e5, -1e5, 1e5);
  }
  EXPECT_FALSE(picture(far, std::vector<double>(8, 1)).empty());
}

TEST_F(Picture, title_of_any_bytes_and_any_length_leaves_the_picture_whole) {
  const TriangleMesh box = make_box();
  const std::string odd = "\xff\xfeé 漢字\n\t%s{}";
  const cv::Mat image = picture(box, std::vector<double>(8, 1),
                                {.title = odd + std::string(5000, 'M'), .caption = std::string(300, 'W')});
  EXPECT_GT(count_near(image, cv::Rect(1580, 0, 20, 900), cv::Vec3b(255, 255, 255), 3), 20 * 900 - 10)
      << "the text runs out of the picture";
}

TEST_F(Picture, lines_are_hidden_behind_the_surface) {
  const TriangleMesh box = make_box();
  PictureOptions options;
  const auto dark_pixels = [&] {
    write_file(folder_ / "s.png", surface_picture(box, options), true);
    const cv::Mat image = read_png(folder_ / "s.png");
    cv::Mat grey;
    cv::cvtColor(image, grey, cv::COLOR_BGR2GRAY);
    return cv::countNonZero(grey < 95);
  };
  const int plain = dark_pixels();
  options.lines = {{Vec3(-0.5, 0, 0), Vec3(0.5, 0, 0)}};  // inside
  EXPECT_EQ(dark_pixels(), plain);
  options.lines = {{Vec3(-1, -1, -1), Vec3(1, -1, 1)},
                   {Vec3(-1, 1, -1), Vec3(1, 1, 1)},
                   {Vec3(1, -1, -1), Vec3(1, 1, 1)},
                   {Vec3(-1, -1, -1), Vec3(-1, 1, 1)}};
  EXPECT_GT(dark_pixels(), plain + 300);
}

}  // namespace
}  // namespace tunica
