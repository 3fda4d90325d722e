using System;

namespace ManipNet.Client
{
    /// <summary>
    /// Finds the rotation about the origin that turns points nearest to others, in the sense of least squares. Source: B. K.
    /// P. Horn, "Closed-form solution of absolute orientation using unit quaternions", 1987.
    /// </summary>
    static class PointAlignment
    {
        const int Squarings = 40;

        public static Quat Solve(Vec3[] from, Vec3[] to)
        {
            double xx = 0, xy = 0, xz = 0, yx = 0, yy = 0, yz = 0, zx = 0, zy = 0, zz = 0;
            for (int i = 0; i < from.Length; i++)
            {
                Vec3 a = from[i], b = to[i];
                xx += (double)a.X * b.X;
                xy += (double)a.X * b.Y;
                xz += (double)a.X * b.Z;
                yx += (double)a.Y * b.X;
                yy += (double)a.Y * b.Y;
                yz += (double)a.Y * b.Z;
                zx += (double)a.Z * b.X;
                zy += (double)a.Z * b.Y;
                zz += (double)a.Z * b.Z;
            }
            double[,] n =
            {
                { xx + yy + zz, yz - zy, zx - xz, xy - yx },
                { yz - zy, xx - yy - zz, xy + yx, zx + xz },
                { zx - xz, xy + yx, yy - xx - zz, yz + zy },
                { xy - yx, zx + xz, yz + zy, zz - xx - yy },
            };
            double[] q = LargestEigenvector(n);
            return new Quat((float)q[1], (float)q[2], (float)q[3], (float)q[0]).Normalized;
        }

        /// <summary>
        /// Squares the matrix until only its largest eigenvalue counts, after making all of them positive. Each column is
        /// then a multiple of the eigenvector.
        /// </summary>
        static double[] LargestEigenvector(double[,] n)
        {
            double norm = 0;
            foreach (double value in n) norm += value * value;
            for (int i = 0; i < 4; i++) n[i, i] += Math.Sqrt(norm);
            for (int k = 0; k < Squarings; k++) n = Square(n);
            int longest = 0;
            for (int i = 1; i < 4; i++)
                if (n[i, i] > n[longest, longest]) longest = i;
            return new[] { n[0, longest], n[1, longest], n[2, longest], n[3, longest] };
        }

        static double[,] Square(double[,] n)
        {
            var product = new double[4, 4];
            double trace = 0;
            for (int i = 0; i < 4; i++)
            {
                for (int j = 0; j < 4; j++)
                    for (int k = 0; k < 4; k++) product[i, j] += n[i, k] * n[k, j];
                trace += product[i, i];
            }
            for (int i = 0; i < 4; i++)
                for (int j = 0; j < 4; j++) product[i, j] /= trace;
            return product;
        }
    }
}
