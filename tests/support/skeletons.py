"""Names of joints in other programs: labels of their files and feeds, typed from their documents."""

_FINGERS = ("Thumb", "Index", "Middle", "Ring", "Pinky")

MIXAMO = tuple(
    f"mixamorig:{name}"
    for name in (
        *("Hips", "Spine", "Spine1", "Spine2", "Neck", "Head", "HeadTop_End"),
        *(f"{side}{part}" for side in ("Left", "Right") for part in ("Shoulder", "Arm", "ForeArm", "Hand")),
        *(f"{s}Hand{finger}{n}" for s in ("Left", "Right") for finger in _FINGERS for n in (1, 2, 3, 4)),
        *(f"{s}{part}" for s in ("Left", "Right") for part in ("UpLeg", "Leg", "Foot", "ToeBase", "Toe_End")),
    )
)
ROKOKO = (
    *("hip", "spine", "chest", "neck", "head"),
    *(f"{s}{part}" for s in ("left", "right") for part in ("Shoulder", "UpperArm", "LowerArm", "Hand")),
    *(f"{s}{part}" for s in ("left", "right") for part in ("UpLeg", "Leg", "Foot", "Toe", "ToeEnd")),
    *(
        f"{s}{finger}{bone}"
        for s in ("left", "right")
        for finger in ("Thumb", "Index", "Middle", "Ring", "Little")
        for bone in ("Proximal", "Medial", "Distal", "Tip")
    ),
)
NEWTON = (
    *("Hips", "Spine1", "Spine2", "Spine3", "Spine4", "Neck", "Head"),
    *(f"{s}{part}" for s in ("Right", "Left") for part in ("Shoulder", "Arm", "ForeArm", "Hand")),
    *(f"{s}{part}" for s in ("Right", "Left") for part in ("Thigh", "Shin", "Foot", "Toe", "ToeTip")),
)
XSENS = (
    *("Pelvis", "L5", "L3", "T12", "T8", "Neck", "Head"),
    *("Right Shoulder", "Right Upper Arm", "Right Forearm", "Right Hand"),
    *("Left Shoulder", "Left Upper Arm", "Left Forearm", "Left Hand"),
    *("Right Upper Leg", "Right Lower Leg", "Right Foot", "Right Toe"),
    *("Left Upper Leg", "Left Lower Leg", "Left Foot", "Left Toe"),
)
XSENS_BVH = (
    *("Hips", "Chest", "Chest2", "Chest3", "Chest4", "Neck", "Head", "Head_end"),
    *(f"{s}{part}" for s in ("Right", "Left") for part in ("Collar", "Shoulder", "Elbow", "Wrist", "Wrist_end")),
    *(f"{s}{part}" for s in ("Right", "Left") for part in ("Hip", "Knee", "Ankle", "Toe", "Toe_end")),
)
#: As the BVH reader gives it: joints that coincide with another joint are left out.
CGSPEED = (
    *("Hips", "LeftUpLeg", "LeftLeg", "LeftFoot", "LeftToeBase", "LeftToeBase_end"),
    *("RightUpLeg", "RightLeg", "RightFoot", "RightToeBase", "RightToeBase_end"),
    *("Spine", "Spine1", "Neck1", "Head", "Head_end"),
    *("LeftArm", "LeftForeArm", "LeftHand", "LeftHandIndex1", "LeftHandIndex1_end", "LThumb_end"),
    *("RightArm", "RightForeArm", "RightHand", "RightHandIndex1", "RightHandIndex1_end", "RThumb_end"),
)
CGSPEED_ALL = (
    *CGSPEED,
    *("LHipJoint", "RHipJoint", "LowerBack", "Neck", "LeftShoulder", "RightShoulder"),
    *("LeftFingerBase", "RightFingerBase", "LThumb", "RThumb"),
)
UNITY = (
    *("Hips", "Spine", "Chest", "UpperChest", "Neck", "Head", "Jaw", "LeftEye", "RightEye"),
    *(f"{s}{part}" for s in ("Left", "Right") for part in ("Shoulder", "UpperArm", "LowerArm", "Hand")),
    *(f"{s}{part}" for s in ("Left", "Right") for part in ("UpperLeg", "LowerLeg", "Foot", "Toes")),
    *(
        f"{s}{finger}{bone}"
        for s in ("Left", "Right")
        for finger in ("Thumb", "Index", "Middle", "Ring", "Little")
        for bone in ("Proximal", "Intermediate", "Distal")
    ),
)
VRM1 = tuple(name[0].lower() + name[1:] for name in UNITY)
VROID = (
    *(f"J_Bip_C_{part}" for part in ("Hips", "Spine", "Chest", "UpperChest", "Neck", "Head")),
    *(
        f"J_Bip_{s}_{part}"
        for s in "LR"
        for part in ("Shoulder", "UpperArm", "LowerArm", "Hand", "UpperLeg", "LowerLeg", "Foot", "ToeBase")
    ),
)
MEDIAPIPE = (
    *("nose", "left_eye_inner", "left_eye", "left_eye_outer", "right_eye_inner", "right_eye", "right_eye_outer"),
    *("left_ear", "right_ear", "mouth_left", "mouth_right", "left_shoulder", "right_shoulder", "left_elbow"),
    *("right_elbow", "left_wrist", "right_wrist", "left_pinky", "right_pinky", "left_index", "right_index"),
    *("left_thumb", "right_thumb", "left_hip", "right_hip", "left_knee", "right_knee", "left_ankle", "right_ankle"),
    *("left_heel", "right_heel", "left_foot_index", "right_foot_index"),
)
FREEMOCAP = (*MEDIAPIPE, "head_center", "neck_center", "trunk_center", "hips_center")
COCO = (
    "nose",
    *(
        f"{s}_{part}"
        for part in ("eye", "ear", "shoulder", "elbow", "wrist", "hip", "knee", "ankle")
        for s in ("left", "right")
    ),
)
PLUG_IN_GAIT = (
    *("LFHD", "RFHD", "LBHD", "RBHD", "C7", "T10", "CLAV", "STRN", "RBAK"),
    *(f"L{part}" for part in ("SHO", "UPA", "ELB", "FRM", "WRA", "WRB", "FIN")),
    *(f"R{part}" for part in ("SHO", "UPA", "ELB", "FRM", "WRA", "WRB", "FIN")),
    *("LASI", "RASI", "LPSI", "RPSI", "LTHI", "LKNE", "LTIB", "LANK", "LHEE", "LTOE"),
    *("RTHI", "RKNE", "RTIB", "RANK", "RHEE", "RTOE"),
)
RIZZOLI = (
    *("C7", "T2", "MAI", "IJ", "PX", "L1", "L3", "L5", "LAC", "RAC"),
    *(f"{s}{part}" for s in "LR" for part in ("ASIS", "PSIS", "GT", "LE", "HF", "TT", "LM", "CA", "FM", "SM", "VM")),
)
RIZZOLI_VISUAL3D = (
    *("CV7", "TV2", "SJN", "SXS", "LV1", "LV3", "LV5"),
    *(f"{s}_{part}" for s in "LR" for part in ("IAS", "IPS", "FTC", "FLE", "FME", "FAX", "TTC", "FAL", "TAM", "FCC")),
    *(f"{s}_{part}" for s in "LR" for part in ("FM1", "FM2", "FM5", "SAE", "HLE", "HME", "RSP", "USP", "HM2")),
)
SMPL = (
    *("pelvis", "left_hip", "right_hip", "spine1", "left_knee", "right_knee", "spine2", "left_ankle", "right_ankle"),
    *("spine3", "left_foot", "right_foot", "neck", "left_collar", "right_collar", "head", "left_shoulder"),
    *("right_shoulder", "left_elbow", "right_elbow", "left_wrist", "right_wrist", "left_hand", "right_hand"),
)
SMPL_FBX = (
    *("m_avg_Pelvis", "m_avg_Spine1", "m_avg_Spine2", "m_avg_Spine3", "m_avg_Neck", "m_avg_Head"),
    *(f"m_avg_{s}_{part}" for s in "LR" for part in ("Hip", "Knee", "Ankle", "Foot", "Collar")),
    *(f"m_avg_{s}_{part}" for s in "LR" for part in ("Shoulder", "Elbow", "Wrist", "Hand")),
)
KINECT_1 = (
    *("HipCenter", "Spine", "ShoulderCenter", "Head"),
    *(f"{part}{s}" for s in ("Left", "Right") for part in ("Shoulder", "Elbow", "Wrist", "Hand")),
    *(f"{part}{s}" for s in ("Left", "Right") for part in ("Hip", "Knee", "Ankle", "Foot")),
)
KINECT_2 = (
    *("SpineBase", "SpineMid", "Neck", "Head", "SpineShoulder"),
    *(f"{part}{s}" for s in ("Left", "Right") for part in ("Shoulder", "Elbow", "Wrist", "Hand", "HandTip", "Thumb")),
    *(f"{part}{s}" for s in ("Left", "Right") for part in ("Hip", "Knee", "Ankle", "Foot")),
)
AZURE_KINECT = (
    *("PELVIS", "SPINE_NAVEL", "SPINE_CHEST", "NECK", "HEAD", "NOSE"),
    *(f"{part}_{s}" for s in ("LEFT", "RIGHT") for part in ("CLAVICLE", "SHOULDER", "ELBOW", "WRIST", "HAND")),
    *(f"{part}_{s}" for s in ("LEFT", "RIGHT") for part in ("HANDTIP", "THUMB", "HIP", "KNEE", "ANKLE", "FOOT")),
    *(f"{part}_{s}" for s in ("LEFT", "RIGHT") for part in ("EYE", "EAR")),
)
OPENNI = (
    *("head", "neck", "torso"),
    *(f"{s}_{part}" for s in ("left", "right") for part in ("shoulder", "elbow", "hand", "hip", "knee", "foot")),
)
OPTITRACK = tuple(
    f"Skeleton 001_{name}"
    for name in (
        *("Hip", "Ab", "Chest", "Neck", "Head", "LShoulder", "LUArm", "LFArm", "LHand", "RShoulder", "RUArm", "RFArm"),
        *("RHand", "LThigh", "LShin", "LFoot", "LToe", "RThigh", "RShin", "RFoot", "RToe"),
    )
)
ARKIT = (
    *("root", "hips_joint", *(f"spine_{n}_joint" for n in range(1, 8))),
    *(f"neck_{n}_joint" for n in range(1, 5)),
    "head_joint",
    *(f"{s}_{part}_joint" for s in ("left", "right") for part in ("upLeg", "leg", "foot", "toes", "toesEnd")),
    *(f"{s}_{part}_joint" for s in ("left", "right") for part in ("shoulder_1", "arm", "forearm", "hand")),
    *(
        f"{s}_hand{finger}{n}_joint"
        for s in ("left", "right")
        for finger in ("Index", "Mid", "Pinky", "Ring", "Thumb")
        for n in ("Start", "_1", "_2", "_3", "End")
    ),
)
UNREAL = (
    *("root", "pelvis", *(f"spine_0{n}" for n in range(1, 6)), "neck_01", "neck_02", "head"),
    *(
        f"{part}_{s}"
        for s in "lr"
        for part in ("clavicle", "upperarm", "lowerarm", "hand", "thigh", "calf", "foot", "ball")
    ),
    *(
        f"{finger}_0{n}_{s}"
        for s in "lr"
        for finger in ("thumb", "index", "middle", "ring", "pinky")
        for n in (1, 2, 3)
    ),
    *(f"{part}_twist_01_{s}" for s in "lr" for part in ("upperarm", "lowerarm", "thigh", "calf")),
    *("ik_foot_root", "ik_foot_l", "ik_foot_r", "ik_hand_root", "ik_hand_gun", "ik_hand_l", "ik_hand_r"),
)
UNREAL_4 = tuple(name for name in UNREAL if name not in ("spine_04", "spine_05", "neck_02"))
BIPED = tuple(
    f"Bip01 {name}".strip()
    for name in (
        *("", "Pelvis", "Spine", "Spine1", "Spine2", "Neck", "Head", "HeadNub"),
        *(f"{s} {part}" for s in "LR" for part in ("Clavicle", "UpperArm", "Forearm", "Hand", "Finger0", "Finger0Nub")),
        *(f"{s} {part}" for s in "LR" for part in ("Thigh", "Calf", "Foot", "Toe0", "Toe0Nub")),
    )
)
VALVE = tuple(f"ValveBiped.{name.replace(' ', '_')}" for name in BIPED if "Nub" not in name and name != "Bip01")
CHARACTER_CREATOR = tuple(
    f"CC_Base_{name}"
    for name in (
        *(
            "BoneRoot",
            "Hip",
            "Pelvis",
            "Waist",
            "Spine01",
            "Spine02",
            "NeckTwist01",
            "NeckTwist02",
            "Head",
            "FacialBone",
        ),
        *(f"{s}_{part}" for s in "LR" for part in ("Clavicle", "Upperarm", "Forearm", "Hand", "Mid1", "Mid2", "Mid3")),
        *(f"{s}_{part}" for s in "LR" for part in ("Thigh", "Calf", "Foot", "ToeBase")),
    )
)
RIGIFY = (
    *("spine", *(f"spine.00{n}" for n in range(1, 7))),
    *(f"{part}.{s}" for s in "LR" for part in ("pelvis", "breast", "shoulder", "upper_arm", "forearm", "hand")),
    *(f"{part}.{s}" for s in "LR" for part in ("f_middle.01", "thumb.01", "thigh", "shin", "foot", "toe", "heel.02")),
)
POSER = (
    *("hip", "abdomen", "chest", "neck", "head"),
    *(
        f"{s}{part}"
        for s in "lr"
        for part in ("Collar", "Shldr", "ForeArm", "Hand", "Buttock", "Thigh", "Shin", "Foot")
    ),
)
GENESIS_8 = (
    *("hip", "pelvis", "abdomenLower", "abdomenUpper", "chestLower", "chestUpper", "neckLower", "neckUpper", "head"),
    *(
        f"{s}{part}"
        for s in "lr"
        for part in ("Collar", "ShldrBend", "ShldrTwist", "ForearmBend", "ForearmTwist", "Hand")
    ),
    *(f"{s}{part}" for s in "lr" for part in ("ThighBend", "ThighTwist", "Shin", "Foot", "Metatarsals", "Toe", "Mid1")),
)
GENESIS_9 = (
    *("hip", "pelvis", "spine1", "spine2", "spine3", "spine4", "neck1", "neck2", "head"),
    *(f"{s}_{part}" for s in "lr" for part in ("shoulder", "upperarm", "forearm", "hand", "mid1")),
    *(f"{s}_{part}" for s in "lr" for part in ("thigh", "shin", "foot", "metatarsals", "toes")),
)
MMD = (
    *("全ての親", "センター", "グルーブ", "腰", "下半身", "上半身", "上半身2", "首", "頭"),
    *(f"{s}{part}" for s in "左右" for part in ("肩", "腕", "ひじ", "手首", "中指１", "足", "ひざ", "足首", "つま先")),
)
MMD_TOOLS = tuple(f"{name[1:]}.{'L' if name[0] == '左' else 'R'}" if name[0] in "左右" else name for name in MMD)
WEBXR = (
    *("hips", "spine-lower", "spine-middle", "spine-upper", "chest", "neck", "head"),
    *(f"{s}-{part}" for s in ("left", "right") for part in ("shoulder", "scapula", "arm-upper", "arm-lower")),
    *(f"{s}-hand-{part}" for s in ("left", "right") for part in ("wrist-twist", "palm", "wrist", "thumb-metacarpal")),
    *(f"{s}-hand-thumb-{part}" for s in ("left", "right") for part in ("phalanx-proximal", "phalanx-distal", "tip")),
    *(
        f"{s}-hand-{finger}-{part}"
        for s in ("left", "right")
        for finger in ("index", "middle", "ring", "little")
        for part in ("metacarpal", "phalanx-proximal", "phalanx-intermediate", "phalanx-distal", "tip")
    ),
    *(f"{s}-{part}" for s in ("left", "right") for part in ("upper-leg", "lower-leg")),
    *(
        f"{s}-foot-{part}"
        for s in ("left", "right")
        for part in ("ankle-twist", "ankle", "subtalar", "transverse", "ball")
    ),
)
META = tuple(
    f"XR_FULL_BODY_JOINT_{name.replace('-phalanx', '').replace('-', '_').upper()}_META" for name in ("root", *WEBXR)
)
PICO = tuple(f"XR_BODY_JOINT_{name.upper()}_BD" for name in SMPL)
MHR_70 = (
    *("nose", "left-eye", "right-eye", "left-ear", "right-ear"),
    *(f"{s}-{part}" for part in ("shoulder", "elbow", "hip", "knee", "ankle") for s in ("left", "right")),
    *(f"{s}-{part}" for s in ("left", "right") for part in ("big-toe-tip", "small-toe-tip", "heel")),
    *(
        f"{s}-{finger}-{part}"
        for s in ("right", "left")
        for finger in ("thumb", "index", "middle", "ring", "pinky")
        for part in ("tip", "first-joint", "second-joint", "third-joint")
    ),
    *(f"{s}-{part}" for part in ("wrist", "olecranon", "cubital-fossa", "acromion") for s in ("left", "right")),
    "neck",
)
MOCOPI = (
    *("root", *(f"torso_{n}" for n in range(1, 8)), "neck_1", "neck_2", "head"),
    *(f"{s}_{part}" for s in "lr" for part in ("shoulder", "up_arm", "low_arm", "hand")),
    *(f"{s}_{part}" for s in "lr" for part in ("up_leg", "low_leg", "foot", "toes")),
)
