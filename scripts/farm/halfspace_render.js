// SPDX-License-Identifier: GPL-3.0-or-later
//
// Job type of Flamenco 3: frames of a .blend rendered with Halfspace. Copy this file into the folder `scripts` next to
// flamenco-manager and refresh the job types in Blender's submission panel. Each worker's Blender needs the extension;
// a worker without it fails with Blender's message that the engine does not exist.

const JOB_TYPE = {
    label: "Halfspace Render",
    description: "Frames rendered with Halfspace, through the file's acceleration structure or another one",
    settings: [
        { key: "frames", type: "string", required: true,
          eval: "f'{C.scene.frame_start}-{C.scene.frame_end}'",
          description: "Frames to render: '47', '1-30', or '3, 5-10, 47-327'" },
        { key: "chunk_size", type: "int32", default: 1, visible: "submission",
          description: "Frames of one task; Blender starts and the scene is read once per task" },
        { key: "structure", type: "string", default: "", required: false,
          description: "Structure, such as bvh-sah or octree-net:leaf_size=4; empty for the file's. All give equal pictures" },
        { key: "samples", type: "int32", default: 0, required: false,
          description: "Samples per pixel; 0 for the file's" },
        { key: "render_output_path", type: "string", subtype: "file_path", editable: false, required: true,
          eval: "f'{jobname}/render/######'", description: "Where the pictures go" },

        { key: "blendfile", type: "string", required: true, visible: "web", description: "The file to render" },
        { key: "format", type: "string", required: true, visible: "web",
          eval: "C.scene.render.image_settings.file_format", description: "Format of the pictures" },
        { key: "scene", type: "string", required: true, visible: "web", eval: "C.scene.name",
          description: "The scene to render" },
    ],
};

const STRUCTURE = /^[a-z0-9][a-z0-9:=,._-]*$/;

function compileJob(job) {
    const settings = job.settings;
    const setUp = setUpExpression(settings);
    for (const chunk of frameChunker(settings.frames, settings.chunk_size)) {
        const task = author.Task(`render-${chunk}`, "blender");
        task.addCommand(author.Command("blender-render", {
            exe: "{blender}",
            exeArgs: "{blenderArgs}",
            argsBefore: [],
            blendfile: settings.blendfile,
            args: [
                "--engine", "HALFSPACE",
                "--scene", settings.scene,
                ...(setUp ? ["--python-exit-code", "1", "--python-expr", setUp] : []),
                "--render-output", settings.render_output_path,
                "--render-format", settings.format,
                // Blender writes a range of frames with two dots.
                "--render-frame", chunk.replace(/-/g, ".."),
            ],
        }));
        job.addTask(task);
    }
}

// The Python expression that sets what differs from the file, empty if nothing does.
function setUpExpression(settings) {
    const lines = [];
    if (settings.structure) {
        if (!STRUCTURE.test(settings.structure)) {
            throw `structure: expected an id with key=value pairs, got ${settings.structure}`;
        }
        lines.push(`bpy.ops.halfspace.use_spec(spec='${settings.structure}')`, "group.automatic = False");
    }
    if (settings.samples > 0) {
        lines.push(`group.samples = ${settings.samples}`);
    }
    return lines.length ? ["import bpy", "group = bpy.context.scene.halfspace", ...lines].join("; ") : "";
}
