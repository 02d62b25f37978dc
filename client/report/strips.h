#pragma once
// Pictures of a scene side by side: the reference, and what every algorithm has at its end, with its error.

#include <string>
#include <vector>

#include "client/report/panel.h"

namespace lightloom::client::report {

struct Picture {
    const Series* series = nullptr;  ///< None for the reference.
    std::string image, error;        ///< PNG files as sources of an <img>; no error for the reference.
    uint64_t seed = 0;
    double relmse = 0, seconds = 0;  ///< As in the tables, of this seed; seconds with preparation.
};

struct Strip {
    std::vector<Picture> pictures;
    int stops = 0;   ///< By which all images are brightened, chosen by the reference.
    int shrunk = 1;  ///< Pixels of the image per pixel of the picture, in each direction.
    std::vector<std::string> notes;
};

/// The first seed of every algorithm. A file that is missing or does not fit the reference is left out with a note; without a
/// reference there are images alone.
Strip make_strip(const Panel& panel);

}  // namespace lightloom::client::report
