#version 330 core
layout(location = 0) in vec3 position;
#ifdef NORMAL_LOC
layout(location = NORMAL_LOC) in vec3 normal;
out vec3 world_normal;
#endif
#ifdef TANGENT_LOC
// The vertex attribute that glTF calls a tangent carries our shading values.
layout(location = TANGENT_LOC) in vec4 tangent;
out vec4 shading;
#endif
#ifdef TEXCOORD_0_LOC
layout(location = TEXCOORD_0_LOC) in vec2 texcoord_0;
out vec2 uv;
#endif
#ifdef COLOR_0_LOC
layout(location = COLOR_0_LOC) in vec4 color_0;
out vec3 vertex_color;
#endif

uniform mat4 V;
uniform mat4 P;
out vec3 world_position;

void main()
{
    gl_Position = P * (V * vec4(position, 1.0));
    world_position = position;
#ifdef NORMAL_LOC
    world_normal = normal;
#endif
#ifdef TANGENT_LOC
    shading = tangent;
#endif
#ifdef TEXCOORD_0_LOC
    uv = texcoord_0;
#endif
#ifdef COLOR_0_LOC
    vertex_color = color_0.rgb;
#endif
}
