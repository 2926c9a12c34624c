#version 330 core
struct Material {
    vec4 base_color_factor;
#ifdef HAS_BASE_COLOR_TEX
    sampler2D base_color_texture;
#endif
};
uniform Material material;
uniform vec3 cam_pos;
uniform vec3 sun;
uniform vec3 sun_color;
uniform vec3 sky_color;
uniform vec3 ground_color;

in vec3 world_position;
#ifdef NORMAL_LOC
in vec3 world_normal;
#endif
#ifdef TANGENT_LOC
in vec4 shading;
#endif
#ifdef TEXCOORD_0_LOC
in vec2 uv;
#endif
#ifdef COLOR_0_LOC
in vec3 vertex_color;
#endif
out vec4 frag_color;

void main()
{
    vec3 color = material.base_color_factor.rgb;
#ifdef HAS_BASE_COLOR_TEX
    color *= texture(material.base_color_texture, uv).rgb;
#endif
#ifdef COLOR_0_LOC
    color *= vertex_color;
#endif
#ifdef TANGENT_LOC
    vec3 albedo = color * color;  // gamma 2.0 stands in for sRGB's curve: one multiplication instead of a power
    vec3 view = normalize(cam_pos - world_position);
    vec3 n = normalize(world_normal);
    n = dot(n, view) < 0.0 ? -n : n;  // surfaces are two-sided
    float facing = dot(n, sun);
    float direct = facing > 0.0 ? facing : -facing * shading.z;
    // Light through a leaf is yellower than light reflected by it.
    vec3 tint = facing > 0.0 ? vec3(1.0) : vec3(1.25, 1.15, 0.5);
    vec3 sky = mix(ground_color, sky_color, 0.5 + 0.5 * n.z) * shading.y;
    vec3 light = sun_color * (direct * shading.x) * tint + sky;
    vec3 halfway = normalize(view + sun);
    float s = max(dot(n, halfway), 0.0);
    float lobe = s * s; lobe *= lobe; lobe *= lobe; lobe *= lobe;  // s^16: wax on a rough blade
    float grazing = 1.0 - max(dot(n, view), 0.0);
    float fresnel = 0.25 + 0.75 * grazing * grazing * grazing;
    vec3 gloss = shading.w * fresnel * (sun_color * (lobe * shading.x * step(0.0, facing)) + 0.35 * sky_color * shading.y);
    color = sqrt(clamp(albedo * light + gloss, 0.0, 1.0));
#endif
    frag_color = vec4(clamp(color, 0.0, 1.0), 1.0);
}
