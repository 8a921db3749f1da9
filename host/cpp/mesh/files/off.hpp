/// OFF files, ASCII: polygons, normals and colours of vertices, colours of faces.
#pragma once

#include "mesh/files/reader.hpp"

namespace colonnade::mesh {

class OffReader : public MeshReader {
public:
    using MeshReader::MeshReader;

    bool begin(Text bytes) override {
        std::string buffer;
        Lines lines(textOf(bytes, buffer));
        Row words;
        if (!next(lines, words) || !readKeyword(words[0]) ||
            std::find(words.begin(), words.end(), "BINARY") != words.end())
            return refuseFormat("it is no text that starts with OFF, COFF or NOFF");
        words.erase(words.begin());
        // Some programs write the counts right after the keyword, as those of ModelNet40
        if (!counts_.empty()) words.insert(words.begin(), counts_);
        if (words.empty()) next(lines, words);
        const auto countOf = [&](std::size_t at) {
            return words.size() > at && words[at].size() <= 18 && isDigit(words[at][0]) ? wholeOf(words[at])
                                                                                        : std::nullopt;
        };
        const std::optional<std::int64_t> vertices = countOf(0), faces = countOf(1);
        if (!vertices || !faces) return refuseFormat("its OFF header has no numbers of vertices and faces");
        return readVertices(lines, *vertices, *faces) && readFaces(lines, *vertices, *faces);
    }

    bool finish(const std::vector<std::int32_t>&) override { return addTo(polygons_); }

private:
    using Row = std::vector<Text>;

    /// The words of the next line that has some.
    static bool next(Lines& lines, Row& words) {
        words.clear();
        for (Text line; words.empty() && lines.next(line);) words = wordsOf(line.substr(0, line.find('#')));
        return !words.empty();
    }

    bool readKeyword(Text word) {
        const std::size_t letters = std::min(
            word.size(), static_cast<std::size_t>(std::find_if(word.begin(), word.end(), isDigit) - word.begin()));
        counts_ = word.substr(letters);
        word = word.substr(0, letters);
        if (startsWith(word, "ST")) word.remove_prefix(2);
        hasColours_ = startsWith(word, "C");
        word.remove_prefix(hasColours_);
        hasNormals_ = startsWith(word, "N");
        word.remove_prefix(hasNormals_);
        return word == "OFF";
    }

    bool refuseShort(std::int64_t vertices, std::int64_t faces) {
        return refuseTruncated("its header states " + grouped(static_cast<std::uint64_t>(vertices)) + " vertices and " +
                               grouped(static_cast<std::uint64_t>(faces)) + " faces");
    }

    bool readVertices(Lines& lines, std::int64_t count, std::int64_t faces) {
        std::vector<Row> rows;
        Row words;
        bool haveSix = true;
        std::vector<std::array<double, 10>> values;
        std::size_t least = SIZE_MAX;
        Text bad;
        std::size_t badColumn = SIZE_MAX;
        for (std::int64_t row = 0; row < count; ++row) {
            if (!next(lines, words)) return refuseShort(count, faces);
            haveSix &= words.size() == 6 || words.size() == 7;
            least = std::min(least, words.size());
            if (least < 3) continue; // refused: no memory for rows of two bytes
            values.emplace_back();
            values.back().fill(HUGE_VAL);
            for (std::size_t i = 0; i < std::min<std::size_t>(words.size(), 10); ++i) {
                const std::optional<double> number = numberOf(words[i]);
                if (!number && i < badColumn) {
                    bad = words[i];
                    badColumn = i;
                }
                values.back()[i] = number.value_or(HUGE_VAL);
            }
        }
        if (!hasNormals_ && !hasColours_) hasColours_ = count > 0 && haveSix; // some programs leave the C out
        const std::size_t columns = 3 + 3 * hasNormals_ + 3 * hasColours_;
        if (least < columns) return refuse("a vertex has fewer than " + std::to_string(columns) + " numbers");
        if (badColumn < columns + hasColours_) return refuseValue(noNumber(bad));
        for (const auto& row : values) {
            surface.vertices.push_back({row[0], row[1], row[2]});
            if (hasNormals_) polygons_.normals.push_back({row[3], row[4], row[5]});
            if (hasColours_) polygons_.vertexColours.push_back({row[columns - 3], row[columns - 2], row[columns - 1]});
        }
        if (!hasColours_) return true;
        double white = 1;
        for (const Vector& colour : polygons_.vertexColours)
            for (const double value : colour)
                if (value > 1) white = 255;
        for (const auto& row : values) transparent_ += row[columns] < white;
        return true;
    }

    bool readFaces(Lines& lines, std::int64_t vertices, std::int64_t count) {
        Row words;
        std::size_t clear = 0;
        bool hasColours = false;
        std::int64_t least = 0, largest = -1;
        std::vector<Vector> colours;
        for (std::int64_t row = 0; row < count; ++row) {
            if (!next(lines, words)) return refuseShort(vertices, count);
            const std::optional<std::int64_t> size = wholeOf(words[0]);
            if (!size) return refuseValue(noNumber(words[0]));
            if (*size < 0 || *size >= static_cast<std::int64_t>(words.size()))
                return refuse("a face has fewer corners than it states");
            for (std::size_t i = 1; i <= static_cast<std::size_t>(*size); ++i) {
                const std::optional<std::int64_t> index = wholeOf(words[i]);
                if (!index) return refuseValue(noNumber(words[i]));
                least = std::min(least, *index);
                largest = std::max(largest, *index);
                polygons_.corners.push_back(static_cast<std::int32_t>(std::clamp<std::int64_t>(*index, -1, INT32_MAX)));
            }
            polygons_.sizes.push_back(*size);
            words.erase(words.begin(), words.begin() + 1 + static_cast<std::ptrdiff_t>(*size));
            Vector colour;
            colour.fill(std::numeric_limits<double>::quiet_NaN());
            if (words.size() >= 3 && !readColour(words, colour, clear)) return false;
            hasColours |= words.size() >= 3;
            colours.push_back(colour);
        }
        if (least < 0 || largest >= vertices)
            return refuse("a face names vertex " + std::to_string(least < 0 ? least : largest) + ", but the file has " +
                          grouped(static_cast<std::uint64_t>(vertices)) + " vertices");
        losses.add(lost::alpha, transparent_);
        losses.add(lost::faceAlpha, clear);
        if (hasColours_) makeLinear(polygons_.vertexColours, {}, losses);
        if (hasColours) polygons_.colours = std::move(colours);
        return true;
    }

    /// The linear colour after a face's corners: three or four numbers, of which the last is an alpha.
    bool readColour(const Row& words, Vector& colour, std::size_t& clear) {
        double white = 255;
        for (std::size_t i = 0; i < words.size(); ++i)
            if (words[i].find('.') != Text::npos) white = 1;
        for (std::size_t i = 0; i < std::min<std::size_t>(words.size(), 4); ++i) {
            const std::optional<double> number = numberOf(words[i]);
            if (!number) return refuseValue(noNumber(words[i]));
            const double value = std::isnan(*number) ? 0 : *number;
            if (i < 3) colour[i] = linearFromSrgb(std::clamp(value / white, 0.0, 1.0));
            else
                clear += value <
                         (std::any_of(
                              words.begin(), words.begin() + 3, [](Text word) { return word.find('.') != Text::npos; })
                              ? 1.0
                              : 255.0);
        }
        return true;
    }

    std::string counts_;
    bool hasNormals_ = false, hasColours_ = false;
    std::size_t transparent_ = 0;
    Polygons polygons_;
};

} // namespace colonnade::mesh
