//! Every field of MuJoCo's model and of its options, and what becomes of it in the statics.
//!
//! With a version of MuJoCo that brings a new field this does not compile until the field is put
//! into a group. A check of a refused group tells whether the values that a model has there matter.

use mujoco_rs::mujoco_c::{mjModel_, mjOption_};
use mujoco_rs::wrappers::mj_model::{MjtDisableBit, MjtEnableBit};

use super::Treatment::{self, Honoured, InTruth, Refused, SwitchedOff, WithoutInfluence};
use super::{actuators, elements};

/// Makes a table of groups. The pattern in it is the proof that the table is whole: the compiler
/// refuses a pattern in which a field of the structure is missing, or is there twice.
macro_rules! classify {
    ($table:ident of $structure:ident; $($treatment:expr => $($field:ident)+;)+) => {
        pub(super) const $table: &[Treatment] = &[$($treatment),+];
        const _: fn(&$structure) = |structure| {
            let $structure { $($($field: _),+),+ } = structure;
        };
    };
}

classify! { MODEL of mjModel_;
    // Springs in joints; linear ones are honoured.
    InTruth(elements::joint_springs) =>
        jnt_stiffness jnt_stiffnesspoly qpos_spring;
    // Springs in tendons, and the paths of tendons; linear ones straight through sites are honoured.
    InTruth(elements::tendon_springs) =>
        ntendon nwrap nJten tendon_stiffness tendon_stiffnesspoly tendon_lengthspring tendon_adr tendon_num
        tendon_length0 wrap_type wrap_objid wrap_prm ten_J_rownnz ten_J_rowadr ten_J_colind;
    // Tendons that become taut.
    Refused(elements::tendon_limits) =>
        tendon_limited tendon_range tendon_margin tendon_solref_lim tendon_solimp_lim;
    // Dry friction in joints.
    Refused(elements::joint_friction) =>
        dof_frictionloss dof_solref dof_solimp;
    // Dry friction in tendons.
    Refused(elements::tendon_friction) =>
        tendon_frictionloss tendon_solref_fri tendon_solimp_fri;
    // Equality constraints.
    InTruth(elements::equalities) =>
        neq nemax eq_type eq_obj1id eq_obj2id eq_objtype eq_active0 eq_solref eq_solimp eq_data;
    // Weight that is compensated; a part of a body's own weight is honoured.
    InTruth(elements::buoyancy) =>
        ngravcomp flg_gravcomp body_gravcomp jnt_actgravcomp;
    // Deformable bodies.
    Refused(elements::flexes) =>
        nflex nflexnode nflexvert nflexedge nflexelem nflexelemdata nflexstiffness nflexbending nflexelemedge
        nflexshelldata nflextexcoord nJfe nJfv nefm0dof nefm0L nefmCvert flex_contype flex_conaffinity
        flex_condim flex_priority flex_solmix flex_solref flex_solimp flex_friction flex_margin flex_gap
        flex_selfcollide flex_activelayers flex_passive flex_dim flex_matid flex_group flex_interp flex_cellnum
        flex_nodeadr flex_nodenum flex_vertadr flex_vertnum flex_edgeadr flex_edgenum flex_elemadr flex_elemnum
        flex_elemdataadr flex_stiffnessadr flex_elemedgeadr flex_bendingadr flex_shellnum flex_shelldataadr
        flex_texcoordadr flex_nodebodyid flex_vertbodyid flex_vertedgeadr flex_vertedgenum flex_vertedge
        flex_edge flex_edgeflap flex_elem flex_elemtexcoord flex_elemedge flex_elemlayer flex_shell flex_vert
        flex_vert0 flex_vertmetric flex_node flex_node0 flexedge_length0 flexedge_invweight0 flex_radius
        flex_size flex_stiffness flex_bending flex_damping flex_edgestiffness flex_edgedamping flex_edgeequality
        flex_rigid flexedge_rigid flex_centered flex_flatskin flex_bvhadr flex_bvhnum flexedge_J_rownnz
        flexedge_J_rowadr flexedge_J_colind flexvert_J_rownnz flexvert_J_rowadr flexvert_J_colind flex_rgba
        flex_texcoord efm0_dofid efm0_L_rownnz efm0_L_rowadr efm0_L_colind efm0_L efmC_perm;
    // Plugins that act on bodies.
    Refused(elements::plugins) =>
        nplugin npluginattr npluginstate body_plugin plugin plugin_stateadr plugin_statenum plugin_attr
        plugin_attradr;
    // What actuators act on.
    InTruth(actuators::transmission) =>
        nactuator nu nout actuator_trntype actuator_ctrlnum actuator_ctrlspec actuator_outnum
        actuator_cranklength tendon_actfrclimited tendon_actfrcrange;
    // Which joint an actuator holds.
    InTruth(actuators::one_for_each_joint) =>
        actuator_trnid actuator_group;
    // Actuators whose force depends on what was before.
    Refused(actuators::state) =>
        na nhistory actuator_dyntype actuator_dynprm actuator_actadr actuator_actnum actuator_actlimited
        actuator_actrange actuator_actearly actuator_history actuator_historyadr actuator_delay actuator_plugin;
    // The force of an actuator; a spring's is honoured, and so is the gear.
    InTruth(actuators::law) =>
        actuator_gaintype actuator_biastype actuator_gainprm actuator_biasprm actuator_gear actuator_ctrladr
        actuator_outadr;
    // Forces that are cut off.
    InTruth(actuators::force_limits) =>
        actuator_forcelimited actuator_forcerange jnt_actfrclimited jnt_actfrcrange;
    // Commands that are clamped inside the joint's range, which is honoured.
    InTruth(actuators::command_limits) =>
        actuator_ctrllimited actuator_ctrlrange jnt_range;
    // The chain and its masses.
    Honoured =>
        nq nv nbody njnt qpos0 body_parentid body_jntnum body_jntadr body_pos body_quat body_ipos body_mass
        body_subtreemass jnt_type jnt_qposadr jnt_dofadr jnt_bodyid jnt_pos jnt_axis dof_jntid;
    // Tools and instruments.
    Honoured =>
        nsite site_bodyid site_pos site_quat;
    // What collides, is seen and stands in the way; see also what is switched off.
    Honoured =>
        ngeom geom_type geom_contype geom_conaffinity geom_bodyid geom_dataid geom_matid geom_group geom_size
        geom_pos geom_quat geom_margin geom_rgba body_margin nmesh nmeshvert nmeshface mesh_vertadr mesh_vertnum
        mesh_faceadr mesh_facenum mesh_vert mesh_face mat_rgba;
    // Names and options.
    Honoured =>
        names name_bodyadr name_jntadr name_geomadr name_siteadr name_flexadr name_eqadr name_tendonadr
        name_actuatoradr opt;
    // Joint limits.
    SwitchedOff =>
        jnt_limited jnt_solref jnt_solimp jnt_margin;
    // Contacts.
    SwitchedOff =>
        npair nexclude nconmax njmax flg_surfacevel flg_adhesion geom_condim geom_priority geom_plugin
        geom_solmix geom_solref geom_solimp geom_friction geom_gap geom_surfacevel geom_adhesion pair_dim
        pair_geom1 pair_geom2 pair_signature pair_solref pair_solreffriction pair_solimp pair_margin pair_gap
        pair_adhesion pair_friction exclude_signature body_contype body_conaffinity nhfield nhfielddata
        hfield_size hfield_nrow hfield_ncol hfield_adr hfield_data hfield_pathadr;
    // What acts on motion alone: inertia, damping, the medium at rest without wind.
    WithoutInfluence =>
        body_inertia body_iquat body_invweight0 dof_armature dof_damping dof_dampingpoly dof_invweight0 dof_M0
        dof_length tendon_damping tendon_dampingpoly tendon_armature tendon_invweight0 actuator_damping
        actuator_dampingpoly actuator_armature actuator_acc0 actuator_length0 actuator_lengthrange
        jnt_actuatorid tendon_actuatorid geom_fluid;
    // Tables that MuJoCo derives from the above for its own use.
    WithoutInfluence =>
        body_rootid body_weldid body_treeid body_dofnum body_dofadr body_geomnum body_geomadr body_simple
        body_sameframe body_bvhadr body_bvhnum dof_bodyid dof_parentid dof_treeid dof_Madr dof_simplenum
        tree_bodyadr tree_bodynum tree_dofadr tree_dofnum tree_sleep_policy tendon_treenum tendon_treeid nbvh
        nbvhstatic nbvhdynamic noct bvh_depth bvh_child bvh_nodeid bvh_aabb oct_depth oct_child oct_aabb
        oct_coeff geom_sameframe geom_aabb geom_rbound site_sameframe ntree nM nB nC nD nJmom nmeshdegmax
        npolygonmax narena nbuffer buffer B_rownnz B_rowadr B_colind M_rownnz M_rowadr M_colind D_rownnz
        D_rowadr D_diag D_colind mapM2M mapM2D mapD2M signature;
    // Keyframes; bodies that a program moves stand where they are drawn.
    WithoutInfluence =>
        nkey key_time key_qpos key_qvel key_act key_mpos key_mquat key_ctrl nmocap body_mocapid;
    // Sensors.
    WithoutInfluence =>
        nsensor nsensordata sensor_type sensor_datatype sensor_needstage sensor_objtype sensor_objid
        sensor_reftype sensor_refid sensor_intprm sensor_dim sensor_adr sensor_cutoff sensor_noise
        sensor_history sensor_historyadr sensor_delay sensor_interval sensor_user sensor_plugin;
    // The shapes' other faces: hulls, textures, skins.
    WithoutInfluence =>
        nmeshnormal nmeshtexcoord nmeshgraph nmeshpoly nmeshpolyvert nmeshpolymap mesh_bvhadr mesh_bvhnum
        mesh_octadr mesh_octnum mesh_normaladr mesh_normalnum mesh_texcoordadr mesh_texcoordnum mesh_graphadr
        mesh_extrema mesh_normal mesh_texcoord mesh_facenormal mesh_facetexcoord mesh_graph mesh_scale mesh_pos
        mesh_quat mesh_pathadr mesh_polynum mesh_polyadr mesh_polynormal mesh_polyvertadr mesh_polyvertnum
        mesh_polyvert mesh_polymapadr mesh_polymapnum mesh_polymap nskin nskinvert nskintexvert nskinface
        nskinbone nskinbonevert skin_matid skin_group skin_rgba skin_inflate skin_vertadr skin_vertnum
        skin_texcoordadr skin_faceadr skin_facenum skin_boneadr skin_bonenum skin_vert skin_texcoord skin_face
        skin_bonevertadr skin_bonevertnum skin_bonebindpos skin_bonebindquat skin_bonebodyid skin_bonevertid
        skin_bonevertweight skin_pathadr ntex ntexdata tex_type tex_colorspace tex_height tex_width tex_nchannel
        tex_adr tex_data tex_pathadr tex_contenttypeadr nmat mat_texid mat_texuniform mat_texrepeat mat_emission
        mat_specular mat_shininess mat_reflectance mat_metallic mat_roughness;
    // What is seen: cameras, lights, colours, groups.
    WithoutInfluence =>
        vis stat ncam nlight cam_mode cam_bodyid cam_targetbodyid cam_pos cam_quat cam_poscom0 cam_pos0 cam_mat0
        cam_projection cam_fovy cam_ipd cam_resolution cam_output cam_sensorsize cam_intrinsic cam_user
        light_mode light_bodyid light_targetbodyid light_type light_texid light_castshadow light_bulbradius
        light_intensity light_range light_active light_pos light_dir light_poscom0 light_pos0 light_dir0
        light_attenuation light_cutoff light_softness light_exponent light_ambient light_diffuse light_specular
        site_type site_dataid site_matid site_group site_size site_user site_rgba jnt_group tendon_matid
        tendon_group tendon_width tendon_rgba;
    // Names and numbers for users.
    WithoutInfluence =>
        nnumeric nnumericdata ntext ntextdata ntuple ntupledata nuser_body nuser_jnt nuser_geom nuser_site
        nuser_cam nuser_tendon nuser_actuator nuser_sensor nnames npaths nnames_map nuserdata body_user jnt_user
        geom_user tendon_user actuator_user numeric_adr numeric_size numeric_data text_adr text_size text_data
        tuple_adr tuple_size tuple_objtype tuple_objid tuple_objprm name_camadr name_lightadr name_meshadr
        name_skinadr name_hfieldadr name_texadr name_matadr name_pairadr name_excludeadr name_sensoradr
        name_numericadr name_textadr name_tupleadr name_keyadr name_pluginadr names_map paths;
}

classify! { OPTION of mjOption_;
    // Gravity, and the flag that switches it off.
    Honoured =>
        gravity;
    // Wind, where there is a medium.
    InTruth(elements::wind) =>
        wind density viscosity;
    // Flags that switch forces off, see below.
    Refused(actuators::actuation_off) =>
        disableflags;
    // Flags that add something.
    Refused(elements::sleep) =>
        enableflags;
    // Groups of actuators that are disabled.
    Honoured =>
        disableactuator;
    // Time, in which the judge steps.
    Honoured =>
        timestep;
    // Contacts.
    SwitchedOff =>
        o_margin o_solref o_solimp o_friction cone ccd_tolerance ccd_iterations sdf_initpoints sdf_iterations
        impratio;
    // How MuJoCo steps and solves.
    WithoutInfluence =>
        tolerance ls_tolerance noslip_tolerance sleep_tolerance magnetic integrator jacobian solver iterations
        ls_iterations noslip_iterations;
}

/// The same for the flags that disable something: whether the statics look at them.
const _: fn(MjtDisableBit) -> bool = |flag| match flag {
    MjtDisableBit::mjDSBL_CONSTRAINT
    | MjtDisableBit::mjDSBL_EQUALITY
    | MjtDisableBit::mjDSBL_FRICTIONLOSS
    | MjtDisableBit::mjDSBL_LIMIT
    | MjtDisableBit::mjDSBL_SPRING
    | MjtDisableBit::mjDSBL_DAMPER
    | MjtDisableBit::mjDSBL_GRAVITY
    | MjtDisableBit::mjDSBL_CLAMPCTRL
    | MjtDisableBit::mjDSBL_ACTUATION => true,
    MjtDisableBit::mjDSBL_CONTACT
    | MjtDisableBit::mjDSBL_WARMSTART
    | MjtDisableBit::mjDSBL_FILTERPARENT
    | MjtDisableBit::mjDSBL_REFSAFE
    | MjtDisableBit::mjDSBL_SENSOR
    | MjtDisableBit::mjDSBL_MIDPHASE
    | MjtDisableBit::mjDSBL_EULERDAMP
    | MjtDisableBit::mjDSBL_AUTORESET
    | MjtDisableBit::mjDSBL_NATIVECCD
    | MjtDisableBit::mjDSBL_ISLAND
    | MjtDisableBit::mjDSBL_MULTICCD
    | MjtDisableBit::mjNDISABLE => false,
};

/// And for those that enable something.
const _: fn(MjtEnableBit) -> bool = |flag| match flag {
    MjtEnableBit::mjENBL_SLEEP => true,
    MjtEnableBit::mjENBL_OVERRIDE
    | MjtEnableBit::mjENBL_ENERGY
    | MjtEnableBit::mjENBL_FWDINV
    | MjtEnableBit::mjENBL_INVDISCRETE
    | MjtEnableBit::mjENBL_DIAGEXACT
    | MjtEnableBit::mjENBL_IPC
    | MjtEnableBit::mjNENABLE => false,
};
