package colonnade.shading

/** Packs a result's numbers into one integer, so that streams of results are compared as a whole. */
object ResultPacking {

  /** Bits of each number's field. */
  private val fieldBits = 96

  def pack(numbers: Seq[BigInt]): BigInt =
    numbers.reverse.foldLeft(BigInt(0))((all, number) => (all << fieldBits) + number + (BigInt(1) << (fieldBits - 1)))

  def unpack(all: BigInt, count: Int): Seq[BigInt] =
    Seq.tabulate(count)(i =>
      ((all >> (i * fieldBits)) & ((BigInt(1) << fieldBits) - 1)) - (BigInt(1) << (fieldBits - 1))
    )
}
