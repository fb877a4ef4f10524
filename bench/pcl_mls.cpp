// PCL's MovingLeastSquares with upsampling in the local plane, one thread.
// pcl_mls IN OUT RADIUS ORDER SPREAD STEP: float32 x y z of the seeds in IN, of the result in OUT;
// lengths in the seeds' unit. Prints the milliseconds that it took, files left out.
#include <pcl/point_types.h>
#include <pcl/search/kdtree.h>
#include <pcl/surface/mls.h>

#include <ctime>
#include <cstdio>
#include <cstdlib>
#include <fstream>

using Cloud = pcl::PointCloud<pcl::PointXYZ>;

static bool read(const char *path, Cloud &cloud) {
  std::ifstream file(path, std::ios::binary);
  float xyz[3];
  while (file.read(reinterpret_cast<char *>(xyz), sizeof xyz))
    cloud.emplace_back(xyz[0], xyz[1], xyz[2]);
  return !cloud.empty();
}

static bool write(const char *path, const Cloud &cloud) {
  std::ofstream file(path, std::ios::binary);
  for (const auto &point : cloud) file.write(reinterpret_cast<const char *>(point.data), 12);
  return bool(file.flush());
}

int main(int count, char **given) {
  if (count != 7) {
    std::fprintf(stderr, "usage: pcl_mls IN OUT RADIUS ORDER SPREAD STEP\n");
    return 2;
  }
  Cloud::Ptr seeds(new Cloud);
  if (!read(given[1], *seeds)) {
    std::fprintf(stderr, "%s: no points\n", given[1]);
    return 2;
  }
  const std::clock_t begin = std::clock();  // the processor's time
  pcl::MovingLeastSquares<pcl::PointXYZ, pcl::PointXYZ> mls;
  mls.setInputCloud(seeds);
  mls.setSearchMethod(pcl::search::KdTree<pcl::PointXYZ>::Ptr(new pcl::search::KdTree<pcl::PointXYZ>));
  mls.setSearchRadius(std::atof(given[3]));
  mls.setPolynomialOrder(std::atoi(given[4]));
  mls.setUpsamplingMethod(decltype(mls)::SAMPLE_LOCAL_PLANE);
  mls.setUpsamplingRadius(std::atof(given[5]));
  mls.setUpsamplingStepSize(std::atof(given[6]));
  mls.setNumberOfThreads(1);
  Cloud dense;
  mls.process(dense);
  const double took = 1e3 * double(std::clock() - begin) / CLOCKS_PER_SEC;
  if (!write(given[2], dense)) {
    std::fprintf(stderr, "%s: cannot be written\n", given[2]);
    return 1;
  }
  std::printf("%.3f\n", took);
}
