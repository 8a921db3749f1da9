// A design as text: lines "number NAME VALUE" and "layout RECORD FIELD OFFSET WIDTH SIGNED" of its manifest.
#pragma once
#include <sstream>

#include "packer/records.hpp"

namespace colonnade::rays {

struct Design {
    std::map<std::string, std::int64_t> numbers;
    packer::RecordFormat format;

    /// Throws std::invalid_argument for a line that is none, or a value that is missing.
    explicit Design(const std::string& text) {
        std::istringstream lines(text);
        std::string kind, record, name;
        while (lines >> kind) {
            if (kind == "number") {
                std::int64_t value = 0;
                lines >> name >> value;
                numbers[name] = value;
            } else if (kind == "layout") {
                Field field{};
                lines >> record >> name >> field.offset >> field.width >> field.isSigned;
                if (lines && (field.offset < 0 || field.offset > maxBits || field.width < 0 || field.width > maxBits))
                    throw std::invalid_argument("the design's field " + record + " " + name + " is none");
                format.layouts[record][name] = field;
            } else throw std::invalid_argument("the design has a line of the unknown kind '" + kind + "'");
            if (!lines) throw std::invalid_argument("the design has a line that is not complete: " + kind + " " + name);
        }
        for (const char* each : records)
            if (!format.layouts.count(each))
                throw std::invalid_argument("the design has no layout of '" + std::string(each) + "'");
        format.recordBits = ranged("recordBits", 64, maxBits);
        format.vertexBits = ranged("vertexBits", 10, 24);
        format.boxBits = ranged("boxBits", 4, 7);
        format.stackDepth = ranged("stackDepth", 4, 256);
        format.normalFraction = ranged("normalFraction", 1, 30);
        format.bvh = number("bvh") != 0;
        ranged("directionBits", 26, 64);
        ranged("depth", 1, 1 << 22);
        for (const auto& [name, value] : numbers)
            if (value < -maxBits || value > 1 << 22)
                throw std::invalid_argument("the design's " + name + " is " + std::to_string(value) +
                                            ", which no device has");
        for (const auto& [name, layout] : format.layouts)
            for (const auto& [field, at] : layout)
                if (isOfRecords(name) && (at.width > 64 || at.offset + at.width > format.recordBits))
                    throw std::invalid_argument("the design's field " + name + " " + field + " is beyond its record");
    }

    int number(const char* name) const { return static_cast<int>(lookUp(numbers, name)); }

private:
    /// Of records, and of other layouts of a manifest.
    static constexpr int maxBits = 4096;
    static constexpr const char* records[] = {"node", "nearPair", "triangle", "flatPair", "farPair"};

    static bool isOfRecords(const std::string& name) {
        return std::find(std::begin(records), std::end(records), name) != std::end(records);
    }

    int ranged(const char* name, int low, int high) const {
        const std::int64_t value = lookUp(numbers, name);
        if (value < low || value > high)
            throw std::invalid_argument("the design's " + std::string(name) + " is " + std::to_string(value) +
                                        ": a device has " + std::to_string(low) + " to " + std::to_string(high));
        return static_cast<int>(value);
    }
};

} // namespace colonnade::rays
