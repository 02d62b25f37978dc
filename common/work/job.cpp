#include "common/work/job.h"

#include "common/scene/scene.h"
#include "common/work/job_fields.h"

namespace lightloom {

void append_text(std::string& out, std::string_view name, std::string_view value) {
    out += name;
    out += ' ';
    out += std::to_string(value.size());
    out += ' ';
    out += value;
    out += '\n';
}

Digest JobSpec::spec_digest() const { return sha256("lightloom-image 1\n" + fields_text<job_role::kImage>(*this)); }

SceneOptions scene_options(const JobSpec& spec) { return {.width = spec.width, .height = spec.height, .crop = spec.crop}; }

bool same_request(const JobSpec& a, const JobSpec& b) {
    bool same = true;
    for_each_job_field([&]<unsigned Roles, class T>(const JobField<Roles, T>& field) {
        if constexpr ((Roles & job_role::kRequest) != 0) same = same && a.*field.member == b.*field.member;
    });
    return same;
}

}  // namespace lightloom
