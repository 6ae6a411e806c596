// FEBio 4 input. Source: FEBio User Manual 4, chapter 3 (free format input): MeshDomains, Boundary, Loads; tri6 shells
// under "Shell Elements": the nodes define the top face, the bottom follows from thickness and nodal normals.
#include "tunica/core/narrow.hpp"
#include "tunica/io/file/signed_file.hpp"
#include "tunica/io/result/detail/decks.hpp"

#include <fmt/format.h>

#include <array>
#include <cmath>
#include <functional>
#include <map>

namespace tunica {
namespace {

std::string list_of(const std::vector<std::size_t>& nodes) {
  std::string text;
  for (const std::size_t node : nodes) {
    text += fmt::format("{}{}", text.empty() ? "" : ",", node + 1);
  }
  return text;
}

std::string six(const std::array<std::size_t, 6>& nodes) {
  return fmt::format("{},{},{},{},{},{}", nodes[0] + 1, nodes[1] + 1, nodes[2] + 1, nodes[3] + 1, nodes[4] + 1,
                     nodes[5] + 1);
}

std::string triple(const Vec3& v) {
  return fmt::format("{},{},{}", deck_number(v.x()), deck_number(v.y()), deck_number(v.z()));
}

/// Names what is held and what is loaded, and gathers the sets of the mesh that go with it.
class FebWriter {
public:
  FebWriter(const Model& model, const QuadraticShells& shells, double factor)
      : model_(model), shells_(shells), factor_(factor) {}

  std::string text(const StaticRun& run, const std::string& made_by) {
    const std::string boundary = conditions();
    const std::string loads = this->loads();
    const std::string domains = this->domains();
    return "<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n<!-- shells of tunica: mm, N, MPa, tonne -->\n" +
           xml_made_by(made_by) + "<febio_spec version=\"4.0\">\n<Module type=\"solid\"/>\n" + control(run) +
           "<Globals><Constants><T>0</T><R>0</R><Fc>0</Fc></Constants></Globals>\n" + materials() + mesh() + domains +
           data_ + "<Boundary>\n" + boundary + "</Boundary>\n<Loads>\n" + loads +
           "</Loads>\n<LoadData>\n<load_controller id=\"1\" name=\"load\" type=\"loadcurve\">"
           "<interpolate>LINEAR</interpolate><extend>CONSTANT</extend>"
           "<points><pt>0,0</pt><pt>1,1</pt></points></load_controller>\n</LoadData>\n"
           "<Output>\n<plotfile type=\"febio\"><var type=\"displacement\"/><var type=\"shell displacement\"/>"
           "<var type=\"stress\"/><var type=\"shell top stress\"/><var type=\"shell bottom stress\"/></plotfile>\n"
           "</Output>\n</febio_spec>\n";
  }

private:
  static std::string control(const StaticRun& run) {
    const double first = first_increment(run);
    const double steps = std::ceil(1 / first);
    return fmt::format(
        "<Control>\n<analysis>STATIC</analysis>\n<time_steps>{}</time_steps>\n<step_size>{}</step_size>\n"
        "<time_stepper type=\"default\"><max_retries>10</max_retries><dtmin>1e-5</dtmin><dtmax>{}</dtmax>"
        "</time_stepper>\n"
        "<solver type=\"solid\"><symmetric_stiffness>non-symmetric</symmetric_stiffness><max_refs>25</max_refs>"
        "<qn_method type=\"BFGS\"><max_ups>0</max_ups></qn_method></solver>\n</Control>\n",
        steps, deck_number(1 / steps), deck_number(1 / steps));
  }

  [[nodiscard]] std::string materials() const {
    std::string text = "<Material>\n";
    for (std::size_t b = 0; b < model_.shells.size(); ++b) {
      const Material& material = model_.shells[b].material;
      text += fmt::format(
          "<material id=\"{0}\" name=\"material{0}\" type=\"isotropic elastic\">{1}<E>{2}</E><v>{3}</v>"
          "</material>\n",
          b + 1, material.density ? fmt::format("<density>{}</density>", deck_number(*material.density)) : "",
          deck_number(material.young), deck_number(material.poisson));
    }
    return text + "</Material>\n";
  }

  [[nodiscard]] std::string mesh() const {
    std::string text = "<Mesh>\n<Nodes name=\"nodes\">\n";
    for (std::size_t n = 0; n < shells_.nodes.size(); ++n) {
      const Vec3 top = shells_.nodes[n] + shells_.thickness[n] / 2 * shells_.normals[n];
      text += fmt::format("<node id=\"{}\">{}</node>\n", n + 1, triple(top));
    }
    text += "</Nodes>\n";
    for (std::size_t b = 0; b < shells_.bodies.size(); ++b) {
      text += fmt::format("<Elements type=\"tri6\" name=\"body{}\">\n", b + 1);
      each_element(b, [&](std::size_t e) {
        text += fmt::format("<elem id=\"{}\">{}</elem>\n", e + 1, six(shells_.elements[e]));
      });
      text += "</Elements>\n";
    }
    return text + sets_ + "</Mesh>\n";
  }

  void each_element(std::size_t body, const std::function<void(std::size_t)>& work) const {
    const QuadraticShells::Body& part = shells_.bodies[body];
    for (std::size_t e = part.first_element; e < part.first_element + part.elements; ++e) {
      work(e);
    }
  }

  [[nodiscard]] std::string domains() {
    std::string text = "<MeshDomains>\n";
    for (std::size_t b = 0; b < shells_.bodies.size(); ++b) {
      const QuadraticShells::Body& body = shells_.bodies[b];
      text += fmt::format(
          "<ShellDomain name=\"body{0}\" mat=\"material{0}\" type=\"elastic-shell\">"
          "<shell_thickness>{1}</shell_thickness></ShellDomain>\n",
          b + 1, deck_number(body.thickness));
      if (body.thickness_of_nodes) {
        data_ += fmt::format("<ElementData type=\"shell thickness\" elem_set=\"body{}\">\n", b + 1);
        each_element(b, [&](std::size_t e) {
          data_ += fmt::format("<e lid=\"{}\">", e - body.first_element + 1);
          for (std::size_t k = 0; k < 6; ++k) {
            data_ += (k > 0 ? "," : "") + deck_number(shells_.thickness[shells_.elements[e][k]]);
          }
          data_ += "</e>\n";
        });
        data_ += "</ElementData>\n";
      }
    }
    data_ = data_.empty() ? "" : "<MeshData>\n" + data_ + "</MeshData>\n";
    return text + "</MeshDomains>\n";
  }

  std::string node_set(const std::vector<std::size_t>& nodes) {
    const std::string name = fmt::format("nodes{}", ++set_count_);
    sets_ += fmt::format("<NodeSet name=\"{}\">{}</NodeSet>\n", name, list_of(nodes));
    return name;
  }

  /// Component by component: the top face (x, y, z) and, where rotations hold the director, the bottom (sx, sy, sz).
  std::string conditions() {
    std::string text;
    constexpr std::array<char, 3> axes{'x', 'y', 'z'};
    for (std::size_t k = 0; k < 3; ++k) {
      for (const bool bottom : {false, true}) {
        // By the value that is prescribed.
        std::map<double, std::vector<std::size_t>> nodes;
        for (std::size_t n = 0; n < shells_.held.size(); ++n) {
          const HeldNode& held = shells_.held[n];
          const bool director = held.rotation[(k + 1) % 3] && held.rotation[(k + 2) % 3];
          if (held.translation[k] && (!bottom || director)) {
            nodes[held.displacement[narrow<Eigen::Index>(k)]].push_back(n);
          }
        }
        for (const auto& [value, list] : nodes) {
          text += condition(node_set(list), axes[k], bottom, value);
        }
      }
    }
    return text;
  }

  static std::string condition(const std::string& set, char axis, bool bottom, double value) {
    const char* const kind = bottom ? "shell displacement" : "displacement";
    const char* const shell = bottom ? "s" : "";
    if (value != 0) {
      return fmt::format(
          "<bc node_set=\"{}\" type=\"prescribed {}\"><dof>{}{}</dof><value lc=\"1\">{}</value>"
          "<relative>0</relative></bc>\n",
          set, kind, shell, axis, deck_number(value));
    }
    std::string held;
    for (const char other : {'x', 'y', 'z'}) {
      held += fmt::format("<{0}{1}_dof>{2}</{0}{1}_dof>", shell, other, int{other == axis});
    }
    return fmt::format("<bc node_set=\"{}\" type=\"zero {}\">{}</bc>\n", set, kind, held);
  }

  std::string surface(std::size_t body) {
    const std::string name = fmt::format("surface{}", body + 1);
    if (sets_.find("\"" + name + "\"") == std::string::npos) {
      sets_ += fmt::format("<Surface name=\"{}\">\n", name);
      std::size_t id = 0;
      each_element(body, [&](std::size_t e) {
        sets_ += fmt::format("<tri6 id=\"{}\">{}</tri6>\n", ++id, six(shells_.elements[e]));
      });
      sets_ += "</Surface>\n";
    }
    return name;
  }

  /// Half on either face, so that what acts is what acts on the middle. FEBio's pressure pushes against the top face,
  /// and along the normals against the bottom.
  std::string loads() {
    std::string text;
    for (const Load& load : model_.loads) {
      const auto* pressure = std::get_if<PressureLoad>(&load.kind);
      const auto* area = std::get_if<AreaLoad>(&load.kind);
      for (const bool bottom : {false, true}) {
        if (pressure != nullptr) {
          text += fmt::format(
              "<surface_load surface=\"{}\" type=\"pressure\"><pressure lc=\"1\">{}</pressure>"
              "<symmetric_stiffness>0</symmetric_stiffness><linear>{}</linear>"
              "<shell_bottom>{}</shell_bottom></surface_load>\n",
              surface(load.body), deck_number((bottom ? 0.5 : -0.5) * factor_ * pressure->value),
              int{!pressure->follower}, int{bottom});
        } else if (area != nullptr) {
          text += fmt::format(
              "<surface_load surface=\"{}\" type=\"traction\"><scale lc=\"1\">1</scale>"
              "<traction>{}</traction><linear>1</linear><shell_bottom>{}</shell_bottom>"
              "</surface_load>\n",
              surface(load.body), triple(factor_ * 0.5 * area->per_area), int{bottom});
        } else if (const auto* force = std::get_if<ForceLoad>(&load.kind)) {
          std::vector<std::size_t> nodes;
          for (const Index node : force->nodes) {
            nodes.push_back(model_.first_node(load.body) + node);
          }
          const Vec3 each = factor_ * 0.5 * force->total / real(nodes.size());
          text += fmt::format(
              "<nodal_load node_set=\"{}\" type=\"nodal_force\"><value lc=\"1\">{}</value>"
              "<shell_bottom>{}</shell_bottom></nodal_load>\n",
              node_set(nodes), triple(each), int{bottom});
        }
      }
    }
    return text;
  }

  const Model& model_;
  const QuadraticShells& shells_;
  double factor_;
  std::size_t set_count_ = 0;
  std::string sets_;
  std::string data_;
};

}  // namespace

std::string feb_text(const Model& model, const QuadraticShells& shells, const StaticRun& run,
                     const std::string& made_by) {
  return FebWriter(model, shells, last_factor(run)).text(run, made_by);
}

}  // namespace tunica
