using ManipNet.Client.Unity;
using UnityEngine;

/// <summary>
/// Shows a sphere at every joint of both hands. Add this to an empty object and press play while `manipnet-serve
/// --demo` runs.
/// </summary>
public sealed class HandsSample : MonoBehaviour
{
    void Start()
    {
        var receiver = gameObject.AddComponent<ManipNetReceiver>();
        GameObject marker = GameObject.CreatePrimitive(PrimitiveType.Sphere);
        marker.transform.localScale = 0.012f * Vector3.one;
        Show(receiver, ManipNet.Client.Side.Left, marker);
        Show(receiver, ManipNet.Client.Side.Right, marker);
        marker.transform.position = 1000f * Vector3.down;
    }

    void Show(ManipNetReceiver receiver, ManipNet.Client.Side side, GameObject marker)
    {
        var hand = new GameObject(side + " hand");
        hand.transform.SetParent(transform, false);
        hand.AddComponent<ManipNetJoints>().Configure(receiver, side, marker);
    }
}
