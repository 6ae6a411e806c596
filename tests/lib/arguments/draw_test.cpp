// The public functions of lib/draw check what they are given.
#include "damaged.hpp"
#include "shell/families.hpp"
#include "tunica/draw/chart.hpp"
#include "tunica/draw/picture.hpp"
#include "tunica/draw/shaded_surface.hpp"
#include "tunica/draw/slice_sheet.hpp"
#include "tunica/draw/thumbnail.hpp"

namespace tunica {
namespace {

using namespace arguments;
using testing::sphere;

TEST(DrawArguments, MeshesAreChecked) {
  const std::vector<Call<TriangleMesh>> calls{
      {"surface_picture", [](const TriangleMesh& m) { surface_picture(m, {}, {}); }},
      {"thumbnail", [](const TriangleMesh& m) { thumbnail(m, {}, {}); }},
      {"moments_picture",
       [](const TriangleMesh& m) {
         moments_picture({{m, {}, {}, {}, ""}}, {}, {});
       }},
      {"shaded_surface", [](const TriangleMesh& m) { shaded_surface(m, std::vector<double>(m.vertices.size(), 1.0)); }},
      {"moved_picture",
       [](const TriangleMesh& m) {
         moved_picture(m, std::vector<Vec3>(m.vertices.size(), Vec3::Zero()), {}, {}, 1, {});
       }},
  };
  expect_checked(sphere(1), calls);
  for (const auto& call : calls) {
    expect_refused(call.name, [&] { call.of({}); });
    TriangleMesh unused = sphere(1);
    unused.vertices.emplace_back(0, nan, 0);
    expect_refused(call.name + ", a vertex of no triangle", [&] { call.of(unused); });
  }
  expect_checked<TriangleMesh>(sphere(1), {
                                              {"others",
                                               [](const TriangleMesh& m) {
                                                 PictureOptions options;
                                                 options.others = m;
                                                 surface_picture(sphere(1), {}, options);
                                               }},
                                              {"outline",
                                               [](const TriangleMesh& m) {
                                                 PictureOptions options;
                                                 options.outline = m;
                                                 surface_picture(sphere(1), {}, options);
                                               }},
                                          });
}

TEST(DrawArguments, ValuesAndNumbersAreChecked) {
  const TriangleMesh ball = sphere(1);
  const std::vector<double> few(3, 1.0);
  expect_refused("values", [&] { surface_picture(ball, few, {}); });
  expect_refused("values of a thumbnail", [&] { thumbnail(ball, few, {}); });
  expect_refused("values to be shaded", [&] { shaded_surface(ball, few); });
  const std::vector<Vec3> still(ball.vertices.size(), Vec3::Zero());
  expect_refused("displacements", [&] { moved_picture(ball, {}, {}, {}, 1, {}); });
  expect_refused("edges", [&] { moved_picture(ball, still, {{0, ball.vertices.size()}}, {}, 1, {}); });
  for (const double magnify : {0.0, -1.0, nan}) {
    expect_refused("magnification", [&] { moved_picture(ball, still, {}, {}, magnify, {}); });
  }
  expect_refused("pixels", [&] {
    ThumbnailOptions options;
    options.longest = 0;
    thumbnail(ball, {}, options);
  });
  expect_refused("axes", [&] {
    ThumbnailOptions options;
    options.axes[1].x() = nan;
    thumbnail(ball, {}, options);
  });
  expect_refused("lines", [&] {
    PictureOptions options;
    options.lines.push_back({Vec3::Zero(), Vec3(0, infinity, 0)});
    surface_picture(ball, {}, options);
  });
  expect_refused("no moments", [] { moments_picture({}, {}, {}); });
  expect_refused("values of a moment", [&] { moments_picture({{ball, few, {}, {}, ""}}, {}, {}); });
  for (const PictureCut& cut : {PictureCut{Vec3(1, 1, 0), 0}, {Vec3(nan, 0, 0), 0}, {Vec3(1, 0, 0), infinity}}) {
    expect_refused("cut", [&] { moments_picture({{ball, {}, {}, {}, ""}}, {}, cut); });
  }
  expect_refused("no points", [] { (void)picture_axes({}); });
  expect_refused("points", [] { (void)picture_axes({Vec3(0, 0, nan)}); });
  expect_numbers_checked({
      {"diagonal",
       [&](double x) {
         PictureOptions options;
         options.diagonal = x;
         surface_picture(ball, {}, options);
       }},
      {"maximum",
       [&](double x) {
         PictureOptions options;
         options.maximum = x;
         surface_picture(ball, {}, options);
       }},
  });
}

TEST(DrawArguments, ChartsAreChecked) {
  for (const double value : {nan, infinity, -infinity}) {
    Chart mark, failure, guide;
    mark.series.push_back({"s", {{1, value, "", ""}, {2, 1, "", ""}}, false, {}});
    failure.series.push_back({"s", {{1, 1, "", ""}}, false, {{value, "", ""}}});
    guide.guide = ChartGuide{value, ""};
    for (const Chart& bad : {mark, failure, guide}) {
      expect_refused("chart_svg", [&] { chart_svg(bad); });
    }
    expect_refused("pareto_front", [&] { pareto_front(mark); });
  }
}

TEST(DrawArguments, SlicesAreChecked) {
  SlicePanel good;
  good.columns = good.rows = 2;
  good.grey.assign(4, 0);
  good.selected.assign(4, 1);
  good.spacing = Vec2(1, 1);
  EXPECT_NO_THROW(slice_sheet({good, good}, 2, 10));
  SlicePanel none = good, few = good, marks = good, spacing = good;
  none.rows = 0;
  few.grey.pop_back();
  marks.selected.clear();
  spacing.spacing.y() = nan;
  for (const SlicePanel& bad : {none, few, marks, spacing}) {
    expect_refused("slice_sheet", [&] { slice_sheet({good, bad}, 2, 10); });
  }
  expect_refused("no slice", [] { slice_sheet({}, 1, 10); });
  expect_refused("no columns", [&] { slice_sheet({good}, 0, 10); });
  expect_refused("no pixels", [&] { slice_sheet({good}, 1, 0); });
  expect_refused("too many pixels", [&] { slice_sheet({good}, 1000, 2'000'000'000); });
}

}  // namespace
}  // namespace tunica
