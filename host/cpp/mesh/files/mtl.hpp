/// MTL files: materials by name, and the textures `map_Kd` and `map_d` with the options `-s`, `-o` and `-clamp`.
///
/// The format leaves the space of its colours open. Viewers take them as sRGB: three.js' MTLLoader and F3D decode them,
/// Babylon.js, Godot and those of OpenGL's fixed colours show them as they are. Blender reads and writes linear ones,
/// so those of a file that begins with its name are linear. host/colonnade/mesh/materials/materials.py has a table of
/// what becomes of a material.
#pragma once

#include <map>

#include "mesh/files/surface.hpp"
#include "mesh/files/text.hpp"

namespace colonnade::mesh {

/// A texture map: its picture, and the transform of (u, v) with v upwards.
struct TextureMap {
    std::string name;
    Pair scale{1, 1}, offset{0, 0};
    bool isClamped = false;

    bool operator<(const TextureMap& other) const {
        return std::tie(name, scale, offset, isClamped) <
               std::tie(other.name, other.scale, other.offset, other.isClamped);
    }
};

/// A statement of OBJ or MTL without its comment: the keyword, lower case in MTL, and its words.
struct Statement {
    std::string keyword;
    std::vector<std::string> words;

    explicit Statement(Text line) {
        Words from(line);
        keyword = lowered(from.next());
        // Names may have a #
        static constexpr Text names[]{"newmtl", "bump", "disp", "decal", "refl", "norm"};
        const bool isName =
            startsWith(keyword, "map_") || std::find(std::begin(names), std::end(names), keyword) != std::end(names);
        if (!isName && keyword[0] == '#') keyword.clear();
        if (keyword.empty()) return;
        for (Text word = from.next(); !word.empty() && (isName || word[0] != '#'); word = from.next())
            words.emplace_back(word);
    }
};

/// What a material of an MTL file has: the words of each keyword, in lower case.
class MtlEntries {
public:
    std::map<std::string, std::vector<std::string>> words;
    bool isLinear = false;

    FileMaterial material() const {
        FileMaterial found;
        found.albedo = colour("kd", found.albedo, 1);
        const double model = first("illum", 2);
        if (opacity() < 0.5 || model == 4 || model == 6 || model == 7 || model == 9) {
            found.kind = Kind::glass;
            found.albedo = colour("tf", found.albedo, 1);
            const double ior = first("ni", found.ior);
            // Exporters write up to 1 for an unknown index
            if (ior > 1) found.ior = std::min(ior, maxIor);
            found.roughness = share(first("pr", 0));
            return found;
        }
        if (words.count("map_d")) found.alpha = opacity();
        if (first("pm", 0) >= 0.5 || model == 3 || model == 5) {
            found.kind = Kind::mirror;
            found.roughness = share(first("pr", 0));
        } else if (const double rough = first("pr", 1); rough < glossy)
            found.roughness = std::max(share(rough), sharpRoughness);
        if (isLit(found)) {
            const Vector emitted = emission();
            const double most = std::max({1.0, emitted[0], emitted[1], emitted[2]});
            for (int channel = 0; channel < 3; ++channel) found.emission[channel] = emitted[channel] / most;
        }
        return found;
    }

    /// Counts what a picture does not show of it.
    void count(Losses& losses) const {
        const FileMaterial found = material();
        std::size_t maps = 0;
        for (const auto& [keyword, values] : words)
            maps += (startsWith(keyword, "map_") && keyword != "map_kd" && keyword != "map_d") || keyword == "bump" ||
                    keyword == "disp" || keyword == "decal" || keyword == "refl" || keyword == "norm";
        losses.add(lost::otherMaps, maps);
        const Vector emitted = emission();
        const double most = std::max({emitted[0], emitted[1], emitted[2]});
        if (most > 0 && !isLit(found)) losses.add(lost::emission);
        else if (most > 1) losses.add(lost::bright);
        if (opacity() > 0 && opacity() < 1 && !words.count("tf"))
            losses.add(found.kind == Kind::glass ? lost::partlyGlass : lost::blended);
        if (found.kind == Kind::diffuse && first("illum", 2) >= 2 && colour("ks", {}, 1) != Vector{})
            losses.add(lost::highlights);
        static constexpr struct {
            const char *keyword, *lower;
            std::size_t count;
        } numbers[]{{"Kd", "kd", 3}, {"Ke", "ke", 3}, {"Tf", "tf", 3}, {"illum", "illum", 1}, {"d", "d", 1},
                    {"Tr", "tr", 1}, {"Ni", "ni", 1}, {"Pm", "pm", 1}, {"Pr", "pr", 1}};
        for (const auto& one : numbers) {
            const std::vector<std::string>* given = get(one.lower);
            if (!given) continue;
            bool isRead = given->size() >= one.count;
            for (std::size_t i = 0; isRead && i < one.count; ++i)
                isRead = std::isfinite(numberOf((*given)[i]).value_or(HUGE_VAL));
            if (!isRead)
                losses.add(lost::noValues, 1, std::string(one.keyword) + (given->empty() ? "" : " ") + joined(*given));
        }
        const std::vector<std::string>* shininess = get("ns");
        losses.add(lost::negativeShininess,
                   shininess && std::any_of(shininess->begin(), shininess->end(),
                                            [](const std::string& word) { return word[0] == '-'; }));
    }

    /// A texture map; nothing without one. Options that are not used are counted.
    std::optional<TextureMap> map(const char* keyword, Losses& losses) const {
        const std::vector<std::string>* given = get(keyword);
        if (!given || given->empty()) return {};
        static constexpr struct {
            Text name;
            std::size_t values;
        } options[]{{"-s", 3},  {"-o", 3},  {"-t", 3},     {"-clamp", 1},  {"-blendu", 1},  {"-blendv", 1}, {"-cc", 1},
                    {"-mm", 2}, {"-bm", 1}, {"-boost", 1}, {"-texres", 1}, {"-imfchan", 1}, {"-type", 1}};
        TextureMap found;
        std::size_t at = 0;
        const std::size_t last = given->size() - 1;
        while (at < last) {
            const std::string name = lowered((*given)[at]);
            const auto* option =
                std::find_if(std::begin(options), std::end(options), [&](const auto& one) { return one.name == name; });
            if (option == std::end(options)) break;
            const std::size_t begin = ++at;
            const auto isNumber = [&](const std::string& word) {
                return std::isfinite(numberOf(word).value_or(HUGE_VAL));
            };
            while (at < last && at < begin + option->values && (option->values == 1 || isNumber((*given)[at]))) ++at;
            if (name == "-clamp") found.isClamped = at > begin && (*given)[begin] == "on";
            else if ((name == "-s" || name == "-o") && at > begin) {
                Pair& pair = name == "-s" ? found.scale : found.offset;
                const double otherwise = name == "-s" ? 1 : 0;
                pair = {*numberOf((*given)[begin]), at > begin + 1 ? *numberOf((*given)[begin + 1]) : otherwise};
            } else losses.add(lost::mapOptions);
        }
        found.name = joined(std::vector<std::string>(given->begin() + static_cast<std::ptrdiff_t>(at), given->end()));
        while (!found.name.empty() && found.name.back() == '"') found.name.pop_back();
        found.name.erase(0, found.name.find_first_not_of('"'));
        return found;
    }

private:
    static constexpr double glossy = 0.5, sharpRoughness = 0.25, mirrorRoughness = 0.35, maxIor = 4, brightest = 1e6;

    static double share(double value) { return std::clamp(value, 0.0, 1.0); }
    /// Whether the lights are seen on a surface, and its emission with them.
    static bool isLit(const FileMaterial& found) {
        return found.kind == Kind::diffuse || found.roughness > mirrorRoughness;
    }

    const std::vector<std::string>* get(const char* keyword) const {
        const auto found = words.find(keyword);
        return found == words.end() ? nullptr : &found->second;
    }
    static double numberOr(const std::string& word, double otherwise) {
        const std::optional<double> found = numberOf(word);
        return found && std::isfinite(*found) ? *found : otherwise;
    }
    /// The first number of a keyword.
    double first(const char* keyword, double otherwise) const {
        const std::vector<std::string>* given = get(keyword);
        return given && !given->empty() ? numberOr((*given)[0], otherwise) : otherwise;
    }
    Vector colour(const char* keyword, const Vector& otherwise, double most) const {
        const std::vector<std::string>* given = get(keyword);
        if (!given || given->size() < 3) return otherwise;
        Vector found;
        bool isColour = !isLinear && (keyword[1] == 'd' || keyword[1] == 'e'); // Kd or Ke: others are shares of light
        for (int channel = 0; channel < 3; ++channel) {
            isColour =
                isColour && std::isfinite(numberOf((*given)[static_cast<std::size_t>(channel)]).value_or(HUGE_VAL));
            found[channel] = numberOr((*given)[static_cast<std::size_t>(channel)], otherwise[channel]);
        }
        for (double& value : found) {
            if (isColour) value = linearFromSrgb(std::clamp(value, 0.0, brightest));
            value = std::clamp(value, 0.0, most);
        }
        return found;
    }
    Vector emission() const { return colour("ke", {}, HUGE_VAL); }
    /// `d`, else 1 - `Tr`; `Tr` of 1 is opaque, as MeshLab writes it.
    double opacity() const {
        const double transparency = first("tr", 0);
        return first("d", transparency >= 1 ? 1 : 1 - transparency);
    }
};

using MtlMaterials = std::map<std::string, MtlEntries>;

/// Whether a keyword's numbers must be finite and, but for Ns, not negative.
inline bool isChecked(const std::string& keyword) {
    static constexpr Text names[]{"ka", "ks", "kd", "ke", "tf", "ni", "ns", "d", "tr", "illum"};
    return std::find(std::begin(names), std::end(names), keyword) != std::end(names) ||
           (keyword.size() > 1 && keyword[0] == 'p' && Text("rmsc").find(keyword[1]) != Text::npos);
}

/// Adds the materials of an MTL file, which replace those of equal names; a refusal, or none. `where`: the file, in
/// messages.
inline std::string addMaterials(Text bytes, const std::string& where, MtlMaterials& to) {
    std::string buffer;
    const Text text = textOf(bytes, buffer);
    Words begin(text);
    Text author = begin.next();
    if (author == "#") author = begin.next();
    else if (startsWith(author, "#")) author.remove_prefix(1);
    else author = {};
    const Text after = author.substr(std::min<std::size_t>(author.size(), 7));
    const bool isLinear = startsWith(author, "Blender") && (after.empty() || !isOfWord(after[0]));
    MtlMaterials own;
    MtlEntries before, *current = &before; // of no material
    Lines lines(text);
    std::size_t row = 1;
    for (Text line; lines.next(line); ++row) {
        const Statement statement(line);
        if (isChecked(statement.keyword))
            for (const std::string& word : statement.words) {
                const std::optional<double> number = numberOf(word);
                if (!number) break;
                if (!std::isfinite(*number) || (*number < 0 && statement.keyword != "ns"))
                    return where + ", line " + std::to_string(row) + ": " + std::string(trimmed(line)) +
                           ": a material's numbers must be finite and not negative";
            }
        if (statement.keyword == "newmtl") {
            current = &own[joined(statement.words)];
            current->isLinear = isLinear;
        } else if (!statement.keyword.empty()) current->words[statement.keyword] = statement.words;
    }
    for (auto& [name, entries] : own) to[name] = std::move(entries);
    return "";
}

} // namespace colonnade::mesh
