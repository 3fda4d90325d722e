using System;

namespace ManipNet.Client
{
    /// <summary>
    /// The last frames on the 60 Hz grid of their capture times, and the weights of frames that show an instant between
    /// them. The weights are those of a uniform cubic B-spline, whose acceleration never exceeds the frames' second
    /// differences. A lost frame is replaced by the cubic through two neighbours on each side, and beyond the ends the
    /// first or last two frames are continued in a straight line.
    /// </summary>
    public sealed class Ring
    {
        public const int Size = 32;
        public readonly HandsFrame[] Frames = new HandsFrame[Size];
        public readonly double[] Weights = new double[Size];
        readonly long[] _grid = new long[Size];
        readonly long[] _nodes = new long[4];
        long _first, _last;
        bool _empty = true;

        public Ring()
        {
            for (int i = 0; i < Size; i++) Frames[i] = new HandsFrame();
        }

        public void Clear()
        {
            _empty = true;
        }

        /// <summary>Stores a frame and returns another one, which may be overwritten.</summary>
        public HandsFrame Exchange(long grid, HandsFrame frame)
        {
            int slot = Slot(grid);
            HandsFrame free = Frames[slot];
            Frames[slot] = frame;
            if (_empty)
            {
                for (int i = 0; i < Size; i++) _grid[i] = long.MinValue;
                _first = _last = grid;
                _empty = false;
            }
            _grid[slot] = grid;
            _last = Math.Max(_last, grid);
            while (!IsPresent(_first)) _first++;
            return free;
        }

        /// <summary>Sets Weights for a position on the grid and returns the slot of the nearest frame.</summary>
        public int Weigh(double position)
        {
            Array.Clear(Weights, 0, Size);
            position = Math.Min(Math.Max(position, _first), _last);
            if (_first == _last)
            {
                Weights[Slot(_last)] = 1.0;
                return Slot(_last);
            }
            long start = Math.Min((long)Math.Floor(position), _last - 1);
            double f = position - start, g = 1.0 - f;
            Add(start - 1, g * g * g / 6.0);
            Add(start, (3.0 * f * f * f - 6.0 * f * f + 4.0) / 6.0);
            Add(start + 1, (-3.0 * f * f * f + 3.0 * f * f + 3.0 * f + 1.0) / 6.0);
            Add(start + 2, f * f * f / 6.0);
            return Nearest(position);
        }

        int Nearest(double position)
        {
            int nearest = -1;
            double least = double.PositiveInfinity;
            for (long i = _first; i <= _last; i++)
            {
                double distance = Math.Abs(i - position);
                if (!IsPresent(i) || distance >= least) continue;
                least = distance;
                nearest = Slot(i);
            }
            return nearest;
        }

        void Add(long index, double weight)
        {
            if (IsPresent(index)) Weights[Slot(index)] += weight;
            else if (index > _last) Extrapolate(_last, _last - 1, weight);
            else if (index < _first) Extrapolate(_first, _first + 1, weight);
            else Fill(index, weight);
        }

        void Extrapolate(long end, long inner, double weight)
        {
            Add(end, 2.0 * weight);
            Add(inner, -weight);
        }

        void Fill(long index, double weight)
        {
            int count = Collect(index, -1, 0);
            count = Collect(index, 1, count);
            for (int i = 0; i < count; i++)
            {
                double part = weight;
                for (int j = 0; j < count; j++)
                    if (j != i) part *= (double)(index - _nodes[j]) / (_nodes[i] - _nodes[j]);
                Weights[Slot(_nodes[i])] += part;
            }
        }

        int Collect(long index, int step, int count)
        {
            int found = 0;
            for (long i = index + step; i >= _first && i <= _last && found < 2; i += step)
            {
                if (!IsPresent(i)) continue;
                _nodes[count + found++] = i;
            }
            return count + found;
        }

        bool IsPresent(long index)
        {
            return index >= _first && index <= _last && index > _last - Size && _grid[Slot(index)] == index;
        }

        static int Slot(long grid)
        {
            return (int)(((grid % Size) + Size) % Size);
        }
    }
}
