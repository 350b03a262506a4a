// As much of Unity as the package uses, with Unity's names: the package is compiled and run without Unity.
using System;
using System.Collections.Generic;

namespace UnityEngine
{
    public class MonoBehaviour { }

    public struct Vector3
    {
        public float x, y, z;
        public Vector3(float x, float y, float z) { this.x = x; this.y = y; this.z = z; }
    }

    public class Transform { public Vector3 position; }

    public static class Time
    {
        public static double timeAsDouble = 0.25;
        public static float time { get { return (float)timeAsDouble; } }
    }

    // In Unity's order, up to RightToes and UpperChest.
    public enum HumanBodyBones
    {
        Hips, LeftUpperLeg, RightUpperLeg, LeftLowerLeg, RightLowerLeg, LeftFoot, RightFoot, Spine, Chest, Neck, Head,
        LeftShoulder, RightShoulder, LeftUpperArm, RightUpperArm, LeftLowerArm, RightLowerArm, LeftHand, RightHand,
        LeftToes, RightToes, LeftEye, RightEye, Jaw, UpperChest = 54, LastBone = 55
    }

    // Bone n stands at (n, 2 n, 3 n) in quarters of a metre; there is no bone for the toes.
    public class Animator
    {
        public Transform GetBoneTransform(HumanBodyBones bone)
        {
            float n = 0.25f * (int)bone;
            bool toes = bone == HumanBodyBones.LeftToes || bone == HumanBodyBones.RightToes;
            return toes ? null : new Transform { position = new Vector3(n, 2 * n, 3 * n) };
        }
    }
}

namespace UnityEngine.Events
{
    public class UnityEvent<T>
    {
        readonly List<Action<T>> listeners = new List<Action<T>>();
        public void AddListener(Action<T> listener) { listeners.Add(listener); }
        public void Invoke(T value) { foreach (var listener in listeners) listener(value); }
    }
}
