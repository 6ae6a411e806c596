#include "tunica/draw/picture.hpp"

#include "io/picture/shapes.hpp"
#include "tunica/core/narrow.hpp"
#include "tunica/core/threads.hpp"
#include "tunica/draw/detail/canvas.hpp"
#include "tunica/draw/detail/svg_text.hpp"
#include "tunica/draw/thumbnail.hpp"

#include <gtest/gtest.h>
#include <png.h>

#include <algorithm>
#include <array>
#include <cmath>

namespace tunica {
namespace {

using Pixel = std::array<int, 3>;  // red, green, blue

struct Area {
  int x = 0, y = 0, width = 0, height = 0;
  [[nodiscard]] int pixels() const { return width * height; }
};

Image read_png(const std::string& bytes, unsigned format = PNG_FORMAT_RGB) {
  png_image header{};
  header.version = PNG_IMAGE_VERSION;
  EXPECT_NE(png_image_begin_read_from_memory(&header, bytes.data(), bytes.size()), 0) << header.message;
  EXPECT_EQ(header.format, format);
  Image image{narrow<int>(header.width), narrow<int>(header.height), {}};
  image.bytes.resize(PNG_IMAGE_SIZE(header));
  EXPECT_NE(png_image_finish_read(&header, nullptr, image.bytes.data(), 0, nullptr), 0) << header.message;
  return image;
}

Pixel pixel(const Image& image, int x, int y) {
  const std::size_t at = 3 * (narrow<std::size_t>(y) * narrow<std::size_t>(image.width) + narrow<std::size_t>(x));
  return {image.bytes[at], image.bytes[at + 1], image.bytes[at + 2]};
}

Image picture(const TriangleMesh& mesh, const std::vector<double>& values, const PictureOptions& options = {}) {
  return read_png(surface_picture(mesh, values, options));
}

// Values 0 … 2 mm, largest at the vertex that lies farthest along `direction`.
std::vector<double> bump(const TriangleMesh& mesh, const Vec3& direction) {
  std::vector<double> values;
  for (const Vec3& p : mesh.vertices) {
    values.push_back(2 * std::exp(-4 * (p.normalized() - direction.normalized()).squaredNorm()));
  }
  return values;
}

int count_near(const Image& image, const Area& area, const Pixel& colour, int reach) {
  int count = 0;
  for (int y = area.y; y < area.y + area.height; ++y) {
    for (int x = area.x; x < area.x + area.width; ++x) {
      const Pixel here = pixel(image, x, y);
      bool near = true;
      for (std::size_t c = 0; c < 3; ++c) {
        near = near && std::abs(here[c] - colour[c]) <= reach;
      }
      count += near ? 1 : 0;
    }
  }
  return count;
}

// Sum of red, green and blue.
int brightness(const Pixel& colour) { return colour[0] + colour[1] + colour[2]; }

const Area left_view{30, 120, 620, 700};
const Area right_view{690, 120, 620, 700};
const Area bar{1432, 250, 34, 570};
const Pixel ring{13, 89, 191};
const Pixel white{255, 255, 255};

TEST(Picture, IsAPngOfThePromisedSizeWithBothViewsAndTheBar) {
  const TriangleMesh sphere = make_sphere(20, 4);
  const Image image = picture(sphere, bump(sphere, {1, 2, 0.5}), {.title = "A sphere", .diagonal = 69.3});
  ASSERT_EQ(image.width, 1600);
  ASSERT_EQ(image.height, 900);
  EXPECT_LT(count_near(image, left_view, white, 3), 0.7 * left_view.pixels());
  EXPECT_LT(count_near(image, right_view, white, 3), 0.7 * right_view.pixels());
  EXPECT_EQ(count_near(image, bar, white, 3), 0);
  EXPECT_GT(count_near(image, {0, 20, 1000, 50}, {25, 25, 25}, 60), 200) << "no title";
  EXPECT_GT(count_near(image, {0, 840, 400, 60}, {25, 25, 25}, 60), 200) << "no scale of lengths";
}

TEST(Picture, BarGetsDarkerFromZeroToTheLargestValueAndEndsAtARoundNumber) {
  const TriangleMesh sphere = make_sphere(20, 4);
  const Image image = picture(sphere, bump(sphere, {1, -2, 0.5}));
  int before = 766;
  for (int y = bar.y + bar.height - 3; y > bar.y; y -= 20) {
    const int here = brightness(pixel(image, bar.x + 17, y));
    EXPECT_LT(here, before) << y;
    before = here;
  }
  // The sphere's largest value, 2, is round: its colour is that of the bar's top, under some light.
  const Pixel top = pixel(image, bar.x + 17, bar.y + 2);
  EXPECT_GT(count_near(image, left_view, top, 30), 50) << "the largest value is not seen in the front view";
  EXPECT_EQ(count_near(image, right_view, top, 30), 0);
  const Pixel bottom = pixel(image, bar.x + 17, bar.y + bar.height - 3);
  EXPECT_GT(count_near(image, right_view, bottom, 60), 5000) << "small values are not light";
}

TEST(Picture, MomentsStandBesideEachOtherByOneBarAndAreCutWhereAsked) {
  const TriangleMesh ball = make_sphere(20, 4);
  PictureMoment small{ball, std::vector<double>(ball.vertices.size(), 0.1), {}, {}, "at rest"};
  PictureMoment large = small;
  large.values.assign(ball.vertices.size(), 2);
  large.when = "loaded";
  const Image whole = read_png(moments_picture({small, large}, {}, {}));
  const Image cut = read_png(moments_picture({small, large}, {}, PictureCut{Vec3(0, -1, 0), 0}));
  const Pixel top = pixel(whole, bar.x + 17, bar.y + 2);
  for (const Image* image : {&whole, &cut}) {
    EXPECT_EQ(count_near(*image, left_view, top, 30), 0);
    EXPECT_GT(count_near(*image, right_view, top, 60), 5000);
  }
  EXPECT_LT(brightness(pixel(cut, 340, 450)), brightness(pixel(whole, 340, 450))) << "the inner side is darker";
  const TriangleMesh far{{{1e3, 0, 0}, {1e3, 1, 0}, {1e3, 0, 1}}, {{0, 1, 2}}};
  small.surface = far;
  small.values = {0, 0, 0};
  EXPECT_NO_THROW((void)moments_picture({small}, {}, PictureCut{Vec3(1, 0, 0), 0})) << "nothing is left";
}

TEST(Picture, ASectionOfATetrahedronLiesInTheCutAndFacesTheViewerWithLinearValues) {
  const std::vector<Vec3> corners{{0, 0, 0}, {3, 0, 0}, {0, 3, 0}, {0, 0, 3}};
  const auto value = [](const Vec3& p) { return 1 + 2 * p.x() - p.y() + 3 * p.z(); };
  const double slant = std::sqrt(0.5);
  for (const auto& [cut, area] : {std::pair{PictureCut{Vec3(0, 0, 1), 1}, 2.0},
                                  {PictureCut{Vec3(0, 0, -1), -1}, 2.0},
                                  {PictureCut{Vec3(0, 0, 1), 4}, 0.0},
                                  {PictureCut{Vec3(slant, slant, 0), 1.5 * slant}, 1.5 * 1.5 / slant}}) {
    PictureMoment moment{{corners, {}}, {}, {}, {}, ""};
    for (const Vec3& p : corners) {
      moment.values.push_back(value(p));
    }
    add_section(cut, {{3, 1, 0, 2}}, moment);
    Vec3 section = Vec3::Zero();
    for (const auto& [i, j, k] : moment.surface.triangles) {
      const auto& v = moment.surface.vertices;
      section += (v[j] - v[i]).cross(v[k] - v[i]) / 2;
      EXPECT_GT((v[j] - v[i]).cross(v[k] - v[i]).dot(cut.normal), 0);
    }
    EXPECT_NEAR((section - area * cut.normal).norm(), 0, 1e-4);
    for (std::size_t v = corners.size(); v < moment.values.size(); ++v) {
      const Vec3& p = moment.surface.vertices[v];
      EXPECT_NEAR(cut.normal.dot(p), cut.offset, 1e-5);
      EXPECT_LT(cut.normal.dot(p), cut.offset) << "it would be cut away itself";
      EXPECT_NEAR(moment.values[v], value(p), 1e-12);
    }
  }
}

TEST(Picture, AxesHaveTheLettersOfTheSpace) {
  const TriangleMesh ball = make_sphere(20, 3);
  const Image plain = picture(ball, {}, {});
  const Image patient = picture(ball, {}, {.axes = "LPS"});
  std::size_t other = 0;
  for (int y = 0; y < plain.height; ++y) {
    for (int x = 0; x < plain.width; ++x) {
      const bool differs = brightness(pixel(plain, x, y)) != brightness(pixel(patient, x, y));
      other += differs ? 1 : 0;
      EXPECT_TRUE(!differs || y > plain.height / 2) << "the axes stand below";
    }
  }
  EXPECT_GT(other, 50U);
}

TEST(Picture, ARangeMakesTheColoursOfTwoPicturesTheSame) {
  const TriangleMesh sphere = make_sphere(20, 4);
  std::vector<double> small = bump(sphere, {0, -1, 0});
  std::vector<double> large = small;
  for (std::size_t v = 0; v < small.size(); ++v) {
    large[v] = 4 * small[v];
  }
  const auto light = [&](const std::vector<double>& values, const PictureOptions& options) {
    const Image image = picture(sphere, values, options);
    double sum = 0;  // in the middle of the front view
    for (int y = 380; y < 560; ++y) {
      for (int x = 240; x < 440; ++x) {
        sum += brightness(pixel(image, x, y));
      }
    }
    return sum / (180 * 200);
  };
  EXPECT_EQ(light(small, {}), light(large, {}));
  EXPECT_GT(light(small, {.maximum = 8}), light(large, {.maximum = 8}) + 50);
  // What is above the range is the last colour, and the bar says that it goes on.
  const Area above_bar{1432, 228, 34, 16};
  EXPECT_EQ(count_near(picture(sphere, small, {.maximum = 8}), above_bar, {88, 27, 110}, 10), 0);
  EXPECT_GT(count_near(picture(sphere, small, {.maximum = 1}), above_bar, {88, 27, 110}, 10), 100);
}

TEST(Picture, FrontIsLeftAndBackRightWhateverTheValues) {
  const TriangleMesh sphere = make_sphere(20, 4);
  for (const auto& [side, front] :
       {std::pair{Vec3(0, -1, 0), true}, {Vec3(0, 1, 0), false}, {Vec3(0.3, -1, 0.2), true}}) {
    const Image image = picture(sphere, bump(sphere, side));
    EXPECT_GT(count_near(image, front ? left_view : right_view, ring, 25), 60);
    EXPECT_LT(count_near(image, front ? right_view : left_view, ring, 25), 5);
  }
}

TEST(Picture, ASurfaceAlongTheViewIsSeenFromAnotherSide) {
  TriangleMesh rod = make_sphere(20, 4);
  for (Vec3& vertex : rod.vertices) {
    vertex.y() *= 5;
  }
  const Image image = picture(rod, {});
  // Seen along x it fills the width of the picture.
  int columns = 0;
  for (int x = 100; x < 1500; ++x) {
    columns += count_near(image, {x, 40, 1, 380}, white, 3) < 380 ? 1 : 0;
  }
  EXPECT_GT(columns, 1000);
}

TEST(Picture, OtherBodiesAreGreyAndDrawnFromOutsideOnly) {
  const TriangleMesh sphere = make_sphere(20, 4);
  TriangleMesh wall;
  append_square(wall, 60, -40);  // in front, and it faces the front view
  const PictureOptions in_front{.others = wall};
  const Image image = picture(sphere, bump(sphere, {0, -1, 0}), in_front);
  EXPECT_EQ(count_near(image, left_view, ring, 25), 0);
  EXPECT_GT(count_near(image, right_view, {243, 235, 219}, 60), 5000) << "seen from behind, the wall hides the sphere";
}

TEST(Picture, OutlineOfAnotherShapeIsDrawnOverTheSurface) {
  const TriangleMesh sphere = make_sphere(20, 4);
  PictureOptions options{.outline = make_sphere(10, 4), .outline_name = "unloaded"};
  const Image with = picture(sphere, {}, options);
  options.outline = {};
  const Image without = picture(sphere, {}, options);
  int differ = 0;
  for (int y = left_view.y; y < left_view.y + left_view.height; ++y) {
    for (int x = left_view.x; x < left_view.x + left_view.width; ++x) {
      differ += pixel(with, x, y) != pixel(without, x, y) ? 1 : 0;
    }
  }
  // A ring of half the sphere's diameter and a few pixels wide.
  EXPECT_GT(differ, 800);
  EXPECT_LT(differ, 5000);
}

TEST(Canvas, TextIsMeasuredAsItIsDrawnInAnyOfItsScripts) {
  for (const std::string text : {"Hausdorff", "Größe", "μήκος", "толщина", "10 − 5 ≤ 7 µm²"}) {
    Canvas canvas(600, 100);
    canvas.text(text, 50, 60, 40, {0, 0, 0});
    const Image image = read_png(canvas.png());
    int left = 600;
    int right = 0;
    for (int x = 0; x < 600; ++x) {
      if (count_near(image, {x, 0, 1, 100}, white, 100) < 100) {
        left = std::min(left, x);
        right = std::max(right, x);
      }
    }
    EXPECT_NEAR(left, 50, 5) << text;
    EXPECT_NEAR(right, 50 + text_width(text, 40), 5) << text;
  }
}

TEST(Picture, FacesThatPointInwardLookTheSame) {
  const TriangleMesh sphere = make_sphere(20, 3);
  TriangleMesh inward = sphere;
  for (auto& triangle : inward.triangles) {
    std::swap(triangle[1], triangle[2]);
  }
  const Image a = picture(sphere, bump(sphere, {0.2, 1, 0}));
  const Image b = picture(inward, bump(sphere, {0.2, 1, 0}));
  double difference = 0;
  for (std::size_t i = 0; i < a.bytes.size(); ++i) {
    difference += std::abs(a.bytes[i] - b.bytes[i]);
  }
  EXPECT_LT(difference / real(a.bytes.size()), 0.2);
}

TEST(Picture, SameBytesWhateverTheNumberOfThreads) {
  const TriangleMesh sphere = make_sphere(20, 5);
  PictureOptions options{.title = "a", .diagonal = 60};
  set_thread_count(1);
  const std::string one = surface_picture(sphere, bump(sphere, {1, 1, 1}), options);
  set_thread_count(4);
  const std::string four = surface_picture(sphere, bump(sphere, {1, 1, 1}), options);
  set_thread_count(default_thread_count());
  EXPECT_EQ(one, four);
}

TEST(Picture, ValuesWithoutARangeOrWithoutANumberAreDrawn) {
  const TriangleMesh box = make_box();
  EXPECT_NO_THROW(picture(box, std::vector<double>(8, 0), {.diagonal = 3.4}));
  EXPECT_NO_THROW(picture(box, std::vector<double>(8, std::nan("")), {.diagonal = 3.4}));
  EXPECT_NO_THROW(picture(box, std::vector<double>(8, 1e-300), {.diagonal = 3.4}));
  EXPECT_NO_THROW(picture(box, std::vector<double>(8, 1e300), {.diagonal = 3.4}));
  std::vector<double> infinite(8, 1);
  infinite[3] = std::numeric_limits<double>::infinity();
  EXPECT_NO_THROW(picture(box, infinite));
}

TEST(Picture, SurfaceWithoutExtentOrOfOneTriangleIsDrawn) {
  TriangleMesh point;
  point.vertices = {{1, 2, 3}, {1, 2, 3}, {1, 2, 3}};
  point.triangles = {{0, 1, 2}};
  EXPECT_NO_THROW(picture(point, {0, 1, 2}));
  TriangleMesh line = point;
  line.vertices[1] = {5, 2, 3};
  EXPECT_NO_THROW(picture(line, {0, 1, 2}));
  TriangleMesh far = make_box();
  for (Vec3& vertex : far.vertices) {
    vertex = 1e-6 * vertex + Vec3(1e5, -1e5, 1e5);
  }
  EXPECT_NO_THROW(picture(far, std::vector<double>(8, 1)));
}

// What lies on the see-through ground of a thumbnail.
Area covered(const Image& image) {
  int left = image.width, right = -1, top = image.height, bottom = -1;
  for (int y = 0; y < image.height; ++y) {
    for (int x = 0; x < image.width; ++x) {
      if (image.bytes[narrow<std::size_t>(4 * (y * image.width + x) + 3)] != 0) {
        left = std::min(left, x);
        right = std::max(right, x);
        top = std::min(top, y);
        bottom = std::max(bottom, y);
      }
    }
  }
  return {left, top, right - left + 1, bottom - top + 1};
}

TEST(Thumbnail, TheOrganStandsAsInThePictureAndFillsTheLongerSide) {
  TriangleMesh rod = make_sphere(20, 3);
  for (Vec3& vertex : rod.vertices) {
    vertex.z() *= 3;
  }
  const auto small = [&] {
    return read_png(thumbnail(rod, {}, {.longest = 120, .axes = picture_axes(rod.vertices)}), PNG_FORMAT_RGBA);
  };
  const Image upright = small();
  EXPECT_EQ(upright.height, 120);
  EXPECT_NEAR(upright.width, 40, 4);
  const Area organ = covered(upright);
  EXPECT_GE(organ.height, 115);
  EXPECT_LT(organ.height, 120);
  EXPECT_GE(organ.width, upright.width - 3);
  for (Vec3& vertex : rod.vertices) {
    std::swap(vertex.x(), vertex.z());
  }
  EXPECT_EQ(small().width, 120);
}

TEST(Thumbnail, SurfaceWithoutExtentIsDrawn) {
  TriangleMesh point;
  point.vertices = {{1, 2, 3}, {1, 2, 3}, {1, 2, 3}};
  point.triangles = {{0, 1, 2}};
  EXPECT_EQ(read_png(thumbnail(point, {}, {.longest = 120}), PNG_FORMAT_RGBA).width, 1);
  point.vertices[1] = {5, 2, 3};
  EXPECT_EQ(read_png(thumbnail(point, {0, 1, 2}, {.longest = 120, .top = 2}), PNG_FORMAT_RGBA).width, 120);
}

TEST(Picture, TitleOfAnyBytesAndAnyLengthLeavesThePictureWhole) {
  const TriangleMesh box = make_box();
  const std::string odd = "\xff\xfeé 漢字\n\t%s{}";
  const Image image = picture(box, std::vector<double>(8, 1),
                              {.title = odd + std::string(5000, 'M'), .caption = std::string(300, 'W')});
  EXPECT_GT(count_near(image, {1580, 0, 20, 900}, white, 3), 20 * 900 - 10) << "the text runs out of the picture";
}

TEST(Picture, LinesAreHiddenBehindTheSurface) {
  const TriangleMesh box = make_box();
  PictureOptions options;
  const auto dark_pixels = [&] {
    const Image image = picture(box, {}, options);
    int dark = 0;
    for (int y = 36; y < 830; ++y) {
      for (int x = 36; x < 1560; ++x) {
        dark += brightness(pixel(image, x, y)) < 3 * 95 ? 1 : 0;
      }
    }
    return dark;
  };
  const int plain = dark_pixels();
  options.lines = {{Vec3(-0.5, 0, 0), Vec3(0.5, 0, 0)}};  // inside
  EXPECT_EQ(dark_pixels(), plain);
  options.lines = {{Vec3(-1, -1, -1), Vec3(1, -1, 1)},
                   {Vec3(-1, 1, -1), Vec3(1, 1, 1)},
                   {Vec3(1, -1, -1), Vec3(1, 1, 1)},
                   {Vec3(-1, -1, -1), Vec3(-1, 1, 1)}};
  EXPECT_GT(dark_pixels(), plain + 300);
  // Without room between them they would hide the colours.
  options.lines.clear();
  for (int i = 1; i < 1000; ++i) {
    const double height = -1 + 2 * real(i) / 1000;
    options.lines.push_back({Vec3(-0.9, -1, height), Vec3(0.9, -1, height)});
  }
  EXPECT_EQ(dark_pixels(), plain);
}

}  // namespace
}  // namespace tunica
