/// What the readers of mesh files share.
///
/// A reader takes the bytes of a file in four steps, so that its caller may read and decode other files as it does,
/// also later: `begin`; for each of `nextLibrary` a file of materials, or that it is missing; `needPictures`; `finish`
/// with the pictures. A step that is false has refused the file, in one line, `refusal`. Then `surface` has the
/// triangles, and `losses` what is not shown of the file. Numbers of rows and of corners are bounded by the bytes of
/// the file, whatever its header states.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "mesh/files/surface.hpp"
#include "mesh/files/text.hpp"

namespace colonnade::mesh {

class MeshReader {
public:
    /// `where`: the file, in messages.
    explicit MeshReader(std::string where) : where_(std::move(where)) {}
    virtual ~MeshReader() = default;

    virtual bool begin(Text bytes) = 0;
    virtual bool giveMaterials(Text, const std::string&) { return true; }
    virtual bool needPictures() { return true; }
    /// `pictures`: of each that is needed its number among those that are read, -1 if it is not.
    virtual bool finish(const std::vector<std::int32_t>& pictures) = 0;

    /// The name of the next file of materials that the mesh names, all that a statement has, then each word of it;
    /// false if there is none.
    bool nextLibrary(std::string& name) {
        for (; library_ < libraries_.size(); ++library_, word_ = missing_ = 0) {
            if (word_ == 0) words_ = wordsOf(libraries_[library_]);
            const bool isOne = words_.size() < 2;
            if (word_ == 0 || (!isFound_ && !isOne && word_ <= words_.size())) {
                name = word_ == 0 ? libraries_[library_] : std::string(words_[word_ - 1]);
                ++word_;
                return true;
            }
            if (isFound_) continue;
            losses.add(lost::noMaterials, isOne || missing_ == words_.size() ? 1 : missing_);
            lacksMaterials |= isOne || missing_ > 0;
        }
        return false;
    }
    /// Gives the file of `nextLibrary`, or says that it is missing; `where`: the file, in messages.
    bool giveLibrary(std::optional<Text> bytes, const std::string& where) {
        if (word_ == 1) isFound_ = bytes.has_value();
        else missing_ += !bytes;
        return !bytes || giveMaterials(*bytes, where);
    }

    /// A picture that is needed, and whether its border goes on beyond it; others repeat.
    struct PictureUse {
        std::string name;
        bool isClamped;
    };

    bool refuse(const std::string& reason) { return refuseAs("mesh " + where_ + ": " + reason); }
    bool refuseTruncated(const std::string& reason) { return refuseAs("mesh " + where_ + " is truncated: " + reason); }
    bool refuseFormat(const std::string& reason) { return refuseAs(where_ + " cannot be read as a mesh: " + reason); }
    bool refuseValue(const std::string& reason) { return refuseFormat("a value is not valid: " + reason); }
    bool refuseAs(const std::string& line) {
        refusal = oneLine(line);
        return false;
    }

    std::string refusal;
    Losses losses;
    FileSurface surface;
    std::vector<PictureUse> pictures;
    bool lacksMaterials = false; ///< a file of materials is missing

protected:
    void addLibrary(Text names) {
        std::string found(trimmed(names));
        while (!found.empty() && found.back() == '"') found.pop_back();
        found.erase(0, std::min(found.size(), found.find_first_not_of('"')));
        libraries_.push_back(found);
    }
    bool addTo(const Polygons& polygons) {
        const std::string error = addPolygons(surface, polygons, losses);
        return error.empty() || refuse(error);
    }

    const std::string where_;

private:
    std::vector<std::string> libraries_;
    std::vector<Text> words_; ///< of the library
    std::size_t library_ = 0, word_ = 0, missing_ = 0;
    bool isFound_ = false; ///< all that the statement has is one name
};

} // namespace colonnade::mesh
