// Unity's part: starts the component, updates it until a motion was done or some seconds have passed, prints what it hears.
using System;
using System.Reflection;
using System.Threading;
using Kinespace;
using UnityEngine;

public static class Stage
{
    public static void Main(string[] arguments)
    {
        var component = new KinespacePerformer {
            avatar = new Animator(), performer = arguments[0], listens = int.Parse(arguments[1]), answers = int.Parse(arguments[2]) };
        bool over = false;
        component.started.AddListener(name => Console.WriteLine("started " + name));
        component.ended.AddListener(name => Console.WriteLine("ended " + name));
        component.done.AddListener(name => { Console.WriteLine("done " + name); over = true; });
        Call(component, "Start");
        for (int turn = 0; turn < 6000 && !over; turn++)
        {
            Call(component, "LateUpdate");
            Time.timeAsDouble += 1 / 64.0;
            Thread.Sleep(10);
        }
        Console.WriteLine(FormattableString.Invariant(
            $"label {component.Label} phase {component.Phase} speed {component.Speed} amplitude {component.Amplitude}"));
        Call(component, "OnDestroy");
    }

    static void Call(object component, string name)
    {
        component.GetType().GetMethod(name, BindingFlags.Instance | BindingFlags.NonPublic).Invoke(component, null);
    }
}
